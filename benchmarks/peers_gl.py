"""What one would write with moderngl: plain blending, which sorts nothing, and a naive A-buffer of linked lists.

Each is made once of a scene's arrays, which lie on the device from then on, and then called once a frame: it draws, and
returns the image as numpy has it, row 0 on top.
"""

import numpy as np

LONGEST = 64  # what the naive resolve has room for
NODE_BYTES = 16

VERTEX = """#version 450
uniform mat4 clip;
in vec3 in_position;
in vec4 in_color;
out vec4 color;
void main() {
    gl_Position = clip * vec4(in_position, 1.0);
    color = in_color;
}"""

BLEND = """#version 450
in vec4 color;
out vec4 pixel;
void main() { pixel = color; }"""

LISTS = """#version 450
layout(std430, binding = 0) buffer Heads { uint heads[]; };  // a node's number + 1, 0 is the end
layout(std430, binding = 1) buffer Nodes { uvec4 nodes[]; };  // color in half floats, 1/w, next
layout(std430, binding = 2) buffer Counter { uint used; };
uniform uint width;
"""

BUILD = (
    LISTS
    + """
uniform uint capacity;
in vec4 color;
void main() {
    uint node = atomicAdd(used, 1u);
    if (node >= capacity) return;
    uint pixel = uint(gl_FragCoord.y) * width + uint(gl_FragCoord.x);
    uint next = atomicExchange(heads[pixel], node + 1u);
    nodes[node] = uvec4(packHalf2x16(color.rg), packHalf2x16(color.ba), floatBitsToUint(gl_FragCoord.w), next);
}"""
)

SCREEN = """#version 450
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }"""

RESOLVE = (
    LISTS
    + f"""
uniform vec4 background;
out vec4 pixel;
void main() {{
    uint depths[{LONGEST}], at[{LONGEST}];
    int count = 0;
    uint next = heads[uint(gl_FragCoord.y) * width + uint(gl_FragCoord.x)];
    while (next != 0u && count < {LONGEST}) {{
        uvec2 node = nodes[next - 1u].zw;  // 1/w, which is the less the farther, and orders by its bits
        int i = count++;
        for (; i > 0 && depths[i - 1] > node.x; --i) {{ depths[i] = depths[i - 1]; at[i] = at[i - 1]; }}
        depths[i] = node.x;
        at[i] = next - 1u;
        next = node.y;
    }}
    vec4 result = background;
    for (int i = 0; i < count; ++i) {{
        uvec2 halves = nodes[at[i]].xy;
        vec4 color = vec4(unpackHalf2x16(halves.x), unpackHalf2x16(halves.y));
        result = vec4(mix(result.rgb, color.rgb, color.a), color.a + (1.0 - color.a) * result.a);
    }}
    pixel = result;
}}"""
)


def context():
    """A context without a window, by EGL.

    Raises:
        SystemExit: moderngl or EGL is missing.
    """
    try:
        import moderngl
    except ImportError:
        raise SystemExit(
            "moderngl is not installed: pip install -r benchmarks/requirements-peers.txt, "
            "and on Debian apt install libegl1 libegl-mesa0 libgl1-mesa-dri"
        ) from None
    try:
        return moderngl.create_context(standalone=True, backend="egl", require=450)
    except Exception as error:  # moderngl raises a bare Exception
        raise SystemExit(
            f"moderngl finds no OpenGL 4.5 by EGL ({error}): on Debian apt install libegl1 libegl-mesa0 libgl1-mesa-dri"
        ) from None


class _Drawn:
    """A scene on the device: positions (N, 3), faces (M, 3), colors (N, 4) uint8; clip is a 4×4, M @ column."""

    def __init__(self, gl, arrays, clip, size, fragment):
        positions, faces, colors = arrays
        self.gl, self.size = gl, size
        self.program = gl.program(vertex_shader=VERTEX, fragment_shader=fragment)
        self.program["clip"].write(np.ascontiguousarray(clip.T, np.float32).tobytes())
        buffers = [
            (gl.buffer(np.ascontiguousarray(positions, np.float32).tobytes()), "3f", "in_position"),
            (gl.buffer(np.ascontiguousarray(colors, np.uint8).tobytes()), "4f1", "in_color"),
        ]
        indices = gl.buffer(np.ascontiguousarray(faces, np.uint32).tobytes())
        self.mesh = gl.vertex_array(self.program, buffers, indices)

    def target(self, dtype):
        return self.gl.framebuffer([self.gl.texture(self.size, 4, dtype=dtype)])

    def read(self, target, dtype):
        data = target.read(components=4, dtype={"f1": "f1", "f2": "f4", "f4": "f4"}[dtype])
        width, height = self.size
        return np.frombuffer(data, np.uint8 if dtype == "f1" else np.float32).reshape(height, width, 4)[::-1]


class PlainBlending(_Drawn):
    """Hardware blending in submission order, into a target of `dtype`: the wrong image."""

    def __init__(self, gl, arrays, clip, size, background, dtype="f1"):
        super().__init__(gl, arrays, clip, size, BLEND)
        self.frame, self.dtype, self.background = self.target(dtype), dtype, background

    def draw(self):
        gl = self.gl
        self.frame.use()
        self.frame.clear(*self.background)
        gl.enable_only(gl.BLEND)
        gl.blend_func = gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA
        self.mesh.render()

    def __call__(self):
        self.draw()
        return self.read(self.frame, self.dtype)


class LinkedLists(_Drawn):
    """A list a pixel, one atomic a fragment, insertion sort in a local array: the right image, up to LONGEST layers.

    Args:
        capacity: nodes. There is no growing: whoever counts first has as many as there are.
    """

    def __init__(self, gl, arrays, clip, size, background, capacity):
        super().__init__(gl, arrays, clip, size, BUILD)
        self.frame, self.mask = self.target("f4"), self.target("f1")
        self.mask.color_mask = (False,) * 4  # drivers in software lose writes of draws that write colours
        self.heads, self.counter = gl.buffer(reserve=4 * size[0] * size[1]), gl.buffer(reserve=4)
        self.nodes = gl.buffer(reserve=NODE_BYTES * capacity)
        self.resolve = gl.program(vertex_shader=SCREEN, fragment_shader=RESOLVE)
        self.program["width"] = self.resolve["width"] = size[0]
        self.program["capacity"] = capacity
        self.resolve["background"] = background
        self.screen = gl.vertex_array(self.resolve, [])

    def __call__(self):
        gl = self.gl
        for place, buffer in enumerate((self.heads, self.nodes, self.counter)):
            buffer.bind_to_storage_buffer(place)
        self.heads.clear()
        self.counter.clear()
        gl.enable_only(gl.NOTHING)
        self.mask.use()
        self.mesh.render()
        gl.memory_barrier()
        self.frame.use()
        self.screen.render(vertices=3)
        return self.read(self.frame, "f4")
