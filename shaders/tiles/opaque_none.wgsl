// There is no opaque geometry, or it hides nothing: never read.

const opaque_keys = array<u32, 1>(0u);
const opaque_colors = array<vec4f, 1>(vec4f(0.0));
