"""What comes out of files and trimesh objects."""

import json
import sys
import warnings

import numpy as np
import pytest

import abuffer as ab
from abuffer.load import is_loadable, meshes

trimesh = pytest.importorskip("trimesh")

TRIANGLE = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
MIRROR = {"scale": [-1, 1, 1], "translation": [5, 0, 0]}


def attribute(values, dtype=np.float32, normalized=False):
    return np.asarray(values, dtype), normalized


def write_gltf(path, primitives, *, nodes=None, materials=(), **more):
    """A glTF 2.0 file by hand: each primitive is {attribute: (array, normalized), "material": index}.

    Without `nodes`, primitive i is mesh i of node i.
    """
    types = {"<f4": 5126, "|u1": 5121, "<u2": 5123}
    blob, views, accessors, meshes_ = b"", [], [], []
    for primitive in primitives:
        entry = {"attributes": {}, "mode": primitive.get("mode", 4)}
        if "material" in primitive:
            entry["material"] = primitive["material"]
        arrays = {"POSITION": attribute(TRIANGLE)} | {k: v for k, v in primitive.items() if k.isupper()}
        for key, (array, normalized) in arrays.items():
            entry["attributes"][key] = len(accessors)
            views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": array.nbytes})
            accessors.append(
                {
                    "bufferView": len(views) - 1,
                    "componentType": types[array.dtype.str],
                    "normalized": normalized,
                    "count": len(array),
                    "type": f"VEC{array.shape[1]}",
                }
            )
            blob += array.tobytes() + b"\0" * (-array.nbytes % 4)
        meshes_.append({"primitives": [entry]})
    nodes = [{"mesh": i} for i in range(len(meshes_))] if nodes is None else nodes
    children = {child for node in nodes for child in node.get("children", [])}
    gltf = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [i for i in range(len(nodes)) if i not in children]}],
        "nodes": nodes,
        "meshes": meshes_,
        "materials": list(materials),
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
        **more,
    }
    if path.suffix == ".gltf":
        path.with_suffix(".bin").write_bytes(blob)
        gltf["buffers"][0]["uri"] = path.with_suffix(".bin").name
        path.write_text(json.dumps(gltf))
        return path
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    words = [len(text) + len(blob) + 28, len(text)]
    head = b"glTF" + np.array([2, *words], "<u4").tobytes() + b"JSON"
    path.write_bytes(head + text + np.array([len(blob)], "<u4").tobytes() + b"BIN\0" + blob)
    return path


def material(*factor, **more):
    return {"pbrMetallicRoughness": {"baseColorFactor": list(factor)}, **more}


def srgb(linear):
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055


def one(items):
    assert len(items) == 1
    return items[0]


@pytest.fixture
def obj(tmp_path):
    """Three sections, the first and last of one material of opacity 0.5."""
    (tmp_path / "m.mtl").write_text("newmtl red\nKd 0.81 0.13 0.27\nd 0.5\nnewmtl green\nKd 0 1 0\nTr 0.25\n")
    vertices = "".join(f"v {i} {i * i % 7} {i % 2}\n" for i in range(9))
    path = tmp_path / "m.obj"
    path.write_text(f"mtllib m.mtl\n{vertices}usemtl red\nf 1 2 3\nusemtl green\nf 4 5 6\nusemtl red\nf 7 8 9\n")
    return path


# what is loadable, and what is not


def test_paths_and_trimesh_objects_are_loadable(tmp_path):
    mesh = trimesh.creation.box()
    assert all(map(is_loadable, ["a.ply", tmp_path, mesh, trimesh.Scene(mesh)]))
    assert not any(map(is_loadable, [None, 3, [mesh], np.zeros((3, 3)), trimesh.PointCloud(TRIANGLE)]))


def test_is_loadable_does_not_import_trimesh(monkeypatch):
    monkeypatch.delitem(sys.modules, "trimesh")
    assert is_loadable("a.ply")
    assert not is_loadable(3)
    assert "trimesh" not in sys.modules


def test_missing_trimesh_says_what_to_install(tmp_path, monkeypatch):
    path = tmp_path / "box.ply"
    trimesh.creation.box().export(path)
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ab.UnsupportedError, match=r"pip install 'abuffer\[trimesh\]'"):
        meshes(path)


def test_an_old_trimesh_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "box.ply"
    trimesh.creation.box().export(path)
    monkeypatch.setattr(trimesh, "__version__", "4.7.3")
    with pytest.raises(ab.UnsupportedError, match=r"needs trimesh 4\.8 or newer: .*this is 4\.7\.3"):
        meshes(path)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ab.SceneError, match=r"there is no file .*nowhere\.ply' .*PLY, OBJ, STL, OFF, GLB and glTF"):
        meshes(tmp_path / "nowhere.ply")


def test_unknown_extension_names_the_file_and_the_formats(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("hello")
    with pytest.raises(ab.SceneError, match=r"cannot read .*notes\.txt' .*PLY, OBJ, STL, OFF, GLB and glTF.*txt"):
        meshes(path)


@pytest.mark.parametrize("name", ["broken.glb", "broken.gltf", "broken.ply", "broken.obj", "broken.off"])
def test_broken_file_is_named(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"glTF\x02 nothing of the kind")
    with pytest.raises(ab.SceneError, match=name.replace(".", r"\.")):
        meshes(path)


def test_point_cloud_file_has_nothing_to_draw(tmp_path):
    path = tmp_path / "points.ply"
    trimesh.PointCloud(TRIANGLE).export(path)
    with pytest.raises(ab.SceneError, match=r"points\.ply' has no triangles to draw"):
        meshes(path)


def test_empty_scene_has_nothing_to_draw():
    with pytest.raises(ab.SceneError, match=r"trimesh\.Scene has no triangles"):
        meshes(trimesh.Scene())


def test_points_beside_a_mesh_are_warned_about():
    scene = trimesh.Scene([trimesh.creation.box(), trimesh.PointCloud(TRIANGLE)])
    with pytest.warns(UserWarning, match="1 nodes are points or lines"):
        one(meshes(scene))


# formats and plain colours


@pytest.mark.parametrize("kind", ["ply", "stl", "off", "obj", "glb", "gltf"])
def test_positions_and_face_order_of_every_format(tmp_path, kind):
    box = trimesh.creation.box()
    box.faces = box.faces[np.random.default_rng(3).permutation(12)]
    path = tmp_path / f"box.{kind}"
    if kind == "gltf":
        for name, data in trimesh.Scene(box).export(file_type="gltf").items():
            (tmp_path / name.replace("model", "box")).write_bytes(data)
    else:
        box.export(path)
    mesh = one(meshes(str(path)))
    np.testing.assert_allclose(mesh.positions[mesh.faces], box.vertices[box.faces])


@pytest.mark.parametrize("kind", ["ply", "stl", "off"])
def test_without_colours_it_is_the_default_colour_and_translucent(tmp_path, kind):
    path = tmp_path / f"box.{kind}"
    trimesh.creation.box().export(path)
    mesh = one(meshes(path))
    np.testing.assert_array_equal(mesh.colors, ab.Mesh([*TRIANGLE]).colors)
    assert mesh.color_mode == "one"
    assert mesh.opaque is False
    assert mesh.name == path.name


def test_ply_keeps_coincident_vertices_of_different_colours(tmp_path):
    path = tmp_path / "two.ply"
    colors = [
        (255, 0, 0, 51),
        (0, 255, 0, 102),
        (0, 0, 255, 153),
        (9, 9, 9, 255),
        (0, 255, 0, 0),
        (1, 2, 3, 4),
    ]
    rows = [(*p, *c) for p, c in zip(TRIANGLE * 2, colors, strict=True)]
    header = ["ply", "format ascii 1.0", "element vertex 6"]
    header += [f"property float {k}" for k in "xyz"]
    header += [f"property uchar {k}" for k in ("red", "green", "blue", "alpha")]
    header += ["element face 2", "property list uchar int vertex_indices", "end_header"]
    path.write_text("\n".join([*header, *(" ".join(map(str, row)) for row in rows), "3 0 1 2", "3 3 4 5", ""]))
    mesh = one(meshes(path))
    assert mesh.color_mode == "vertex"
    np.testing.assert_allclose(mesh.colors, np.array(colors) / 255, rtol=1e-15)
    np.testing.assert_array_equal(mesh.faces, [(0, 1, 2), (3, 4, 5)])


def test_face_colours_of_a_trimesh_with_as_many_faces_as_vertices():
    colors = np.arange(16, dtype=np.uint8).reshape(4, 4)
    tetrahedron = trimesh.Trimesh([*TRIANGLE, (0, 0, 1)], [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)])
    tetrahedron.visual.face_colors = colors
    mesh = one(meshes(tetrahedron))
    assert mesh.color_mode == "face"
    assert mesh.opaque is False
    np.testing.assert_allclose(mesh.colors, colors / 255, rtol=1e-15)


def test_color_overrides_the_items_own():
    box = trimesh.creation.box()
    box.visual.vertex_colors = np.full((8, 4), 200, np.uint8)
    mesh = one(meshes(box, color=(0.1, 3.0, 0.3, 0.4)))
    np.testing.assert_allclose(mesh.colors, (0.1, 3.0, 0.3, 0.4), rtol=1e-6)


# OBJ


def test_obj_materials_keep_the_numbers_of_the_file(obj):
    colors = [mesh.colors for mesh in meshes(obj)]
    expected = [(0.81, 0.13, 0.27, 0.5), (0, 1, 0, 0.75), (0.81, 0.13, 0.27, 0.5)]
    np.testing.assert_allclose(colors, expected, rtol=1e-6)


def test_obj_sections_come_in_the_files_order(obj):
    assert [mesh.positions[:, 0].tolist() for mesh in meshes(obj)] == [[0, 1, 2], [3, 4, 5], [6, 7, 8]]


def test_obj_is_translucent(obj):
    assert [mesh.opaque for mesh in meshes(obj)] == [False] * 3


def test_obj_names_count_up(obj):
    assert [mesh.name for mesh in meshes(obj)] == ["m.obj", "m.obj_1", "m.obj_2"]


def test_obj_with_texture_coordinates_alone_is_the_default_colour(tmp_path):
    path = tmp_path / "uv.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh = one(meshes(path))
    np.testing.assert_array_equal(mesh.colors, ab.Mesh([*TRIANGLE]).colors)


def test_obj_vertex_colours_multiply_a_material(tmp_path):
    (tmp_path / "c.mtl").write_text("newmtl half\nKd 0.5 0.5 0.5\nd 0.25\n")
    path = tmp_path / "c.obj"
    path.write_text("mtllib c.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nusemtl half\nf 1 2 3\n")
    np.testing.assert_allclose(one(meshes(path)).colors, np.c_[np.eye(3) / 2, np.full(3, 0.25)], rtol=1e-6)


# glTF: colours


def test_gltf_base_colour_becomes_srgb_in_full_precision(tmp_path):
    path = write_gltf(
        tmp_path / "a.glb", [{"material": 0}], materials=[material(0.002, 0.02, 0.9, 0.3, alphaMode="BLEND")]
    )
    expected = [srgb(0.002), srgb(0.02), srgb(0.9), 0.3]
    np.testing.assert_allclose(one(meshes(path)).colors, expected, rtol=1e-6)


def test_gltf_base_colour_stays_linear_on_request(tmp_path):
    path = write_gltf(tmp_path / "a.gltf", [{"material": 0}], materials=[material(0.002, 0.02, 0.9, 0.3)])
    np.testing.assert_allclose(one(meshes(path, space="linear")).colors[:3], [0.002, 0.02, 0.9], rtol=1e-6)


def test_space_has_two_values():
    with pytest.raises(ab.ParameterError, match=r"space must be one of 'srgb', 'linear', got 'gamma'"):
        meshes(trimesh.creation.box(), space="gamma")


@pytest.mark.parametrize(
    "colors",
    [
        attribute([(51, 0, 0, 255), (0, 102, 0, 255), (0, 0, 255, 0)], np.uint8, True),
        attribute([(13107, 0, 0, 65535), (0, 26214, 0, 65535), (0, 0, 65535, 0)], np.uint16, True),
        attribute([(0.2, 0, 0, 1), (0, 0.4, 0, 1), (0, 0, 1, 0)]),
    ],
    ids=["uint8", "uint16", "float"],
)
@pytest.mark.parametrize("factor", [(0.5, 0.5, 0.5, 0.5), None], ids=["material", "no material"])
def test_gltf_vertex_colours_multiply_the_material(tmp_path, colors, factor):
    primitive = {"COLOR_0": colors} | ({} if factor is None else {"material": 0})
    path = write_gltf(tmp_path / "a.glb", [primitive], materials=[material(*(factor or (1, 1, 1, 1)))])
    mesh = one(meshes(path, space="linear", opaque=False))
    expected = np.array([(0.2, 0, 0, 1), (0, 0.4, 0, 1), (0, 0, 1, 0)]) * (factor or 1)
    np.testing.assert_allclose(mesh.colors, expected, rtol=1e-6)
    assert mesh.color_mode == "vertex"


def test_gltf_vertex_colours_without_alpha_become_srgb(tmp_path):
    path = write_gltf(tmp_path / "a.glb", [{"COLOR_0": attribute(np.full((3, 3), 0.5))}])
    np.testing.assert_allclose(one(meshes(path)).colors, [(*[srgb(0.5)] * 3, 1)] * 3, rtol=1e-6)


def test_gltf_without_material_is_the_formats_default_white_opaque(tmp_path):
    mesh = one(meshes(write_gltf(tmp_path / "a.glb", [{}])))
    np.testing.assert_array_equal(mesh.colors, (1, 1, 1, 1))
    assert mesh.opaque is True


def test_plain_vertex_colours_of_a_trimesh_are_not_converted():
    box = trimesh.creation.box(vertex_colors=(51, 102, 153, 128))
    np.testing.assert_allclose(one(meshes(box)).colors[0], np.array([51, 102, 153, 128]) / 255, rtol=1e-15)


def test_textures_are_ignored_with_one_warning(tmp_path):
    textured = material(1, 0, 0, 0.5, alphaMode="BLEND")
    textured["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
    path = write_gltf(
        tmp_path / "a.glb",
        [{"material": 0}, {"material": 0}, {}],
        materials=[textured],
        textures=[{"source": 0}],
        images=[{"uri": "missing.png"}],
    )
    with pytest.warns(UserWarning, match="2 of 3 meshes have a texture image, which is ignored") as caught:
        result = meshes(path)
    assert len(caught) == 1
    np.testing.assert_allclose(result[0].colors, (1, 0, 0, 0.5))


# glTF: alphaMode


def alpha_mode(tmp_path, mode, **options):
    """The mesh of a file whose material has alpha 0.25, that mode, and a cut-off of 0.2 if it is MASK."""
    more = {} if mode is None else {"alphaMode": mode}
    more |= {"alphaCutoff": 0.2} if mode == "MASK" else {}
    path = write_gltf(tmp_path / "a.glb", [{"material": 0}], materials=[material(1, 1, 1, 0.25, **more)])
    return one(meshes(path, **options))


@pytest.mark.parametrize(
    ("mode", "opaque", "alpha", "cutoff"),
    [
        (None, True, 1, None),
        ("OPAQUE", True, 1, None),
        ("MASK", True, 0.25, 0.2),
        ("BLEND", False, 0.25, None),
    ],
)
def test_alpha_mode_decides(tmp_path, mode, opaque, alpha, cutoff):
    mesh = alpha_mode(tmp_path, mode)
    assert (mesh.opaque, mesh.colors[3], mesh.alpha_cutoff) == (opaque, alpha, cutoff)


def test_an_alpha_below_one_with_a_cutoff_stays_alpha_tested(tmp_path):
    mesh = alpha_mode(tmp_path, "MASK", alpha=0.4, alpha_cutoff=0.1)
    assert (mesh.opaque, mesh.alpha_cutoff) == (True, 0.1)


@pytest.mark.parametrize(
    ("mode", "alpha"), [(None, 1), ("OPAQUE", 1), ("MASK", 1), ("BLEND", 0.25)], ids=["absent", "O", "M", "B"]
)
def test_an_alpha_below_one_makes_it_translucent(tmp_path, mode, alpha):
    mesh = alpha_mode(tmp_path, mode, alpha=0.4)
    assert (mesh.opaque, mesh.colors[3], mesh.alpha_cutoff) == (False, alpha, None)


def test_an_alpha_of_one_changes_nothing(tmp_path):
    assert alpha_mode(tmp_path, "OPAQUE", alpha=1.0).opaque is True


@pytest.mark.parametrize("color", [(1, 0, 0, 0.5), np.array([255, 0, 0, 128], np.uint8)])
def test_a_translucent_color_makes_it_translucent(tmp_path, color):
    mesh = alpha_mode(tmp_path, "OPAQUE", color=color)
    assert mesh.opaque is False
    assert mesh.colors[3] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("color", [(1, 0, 0), (1, 0, 0, 1), np.array([255, 0, 0, 255], np.uint8)])
def test_an_opaque_color_keeps_the_alpha_mode(tmp_path, color):
    assert alpha_mode(tmp_path, "OPAQUE", color=color).opaque is True
    assert alpha_mode(tmp_path, "BLEND", color=color).opaque is False


def test_opaque_false_overrides_the_alpha_mode_and_counts_the_alpha(tmp_path):
    mesh = alpha_mode(tmp_path, "OPAQUE", opaque=False)
    assert (mesh.opaque, mesh.colors[3], mesh.alpha_cutoff) == (False, 0.25, None)


def test_a_blend_is_for_what_the_alpha_mode_does_not_make_opaque(tmp_path):
    assert alpha_mode(tmp_path, "BLEND", blend="additive").blend == "additive"
    assert alpha_mode(tmp_path, "OPAQUE", blend="additive", opaque=False).blend == "additive"
    assert alpha_mode(tmp_path, "OPAQUE").blend == "over"
    with pytest.raises(ab.ParameterError, match="opaque surfaces are not blended: give opaque=False"):
        alpha_mode(tmp_path, "OPAQUE", blend="additive")


def test_opaque_true_overrides_the_alpha_mode(tmp_path):
    assert alpha_mode(tmp_path, "BLEND", opaque=True).opaque is True


def test_alpha_cutoff_overrides_the_materials(tmp_path):
    mesh = alpha_mode(tmp_path, "MASK", alpha_cutoff=0.7)
    assert (mesh.opaque, mesh.alpha_cutoff) == (True, 0.7)


def test_a_trimesh_with_a_pbr_material_is_read_like_a_file():
    pbr = trimesh.visual.material.PBRMaterial(baseColorFactor=(51, 51, 51, 51), alphaMode="BLEND")
    box = trimesh.creation.box()
    box.visual = trimesh.visual.TextureVisuals(material=pbr)
    mesh = one(meshes(box))
    np.testing.assert_allclose(mesh.colors, (*[srgb(0.2)] * 3, 0.2), rtol=1e-6)
    assert mesh.opaque is False


# nodes


def test_each_node_is_a_mesh_in_the_files_order_with_its_name(tmp_path):
    nodes = [{"name": name, "mesh": 0, "camera": 0} for name in "cab"] + [{"mesh": 0}]
    nodes[1]["children"] = [2]
    camera = {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "aspectRatio": 1}}
    path = write_gltf(tmp_path / "a.glb", [{}], nodes=nodes, cameras=[camera])
    assert [mesh.name for mesh in meshes(path)] == ["c", "a", "b", "node_3"]


def test_primitives_of_one_node_share_its_name(tmp_path):
    primitive = {"attributes": {"POSITION": 0}}
    mesh = {"primitives": [{**primitive, "material": 0}, {**primitive, "material": 1}]}
    colors = [material(1, 0, 0, 1), material(0, 1, 0, 1)]
    nodes = [{"name": "leaf", "mesh": 0}]
    result = meshes(write_gltf(tmp_path / "a.glb", [{}], nodes=nodes, materials=colors, meshes=[mesh]))
    assert [mesh.name for mesh in result] == ["leaf", "leaf"]
    np.testing.assert_array_equal([mesh.colors for mesh in result], [(1, 0, 0, 1), (0, 1, 0, 1)])


def test_transforms_are_applied_down_the_graph(tmp_path):
    nodes = [
        {"name": "up", "translation": [0, 0, 10], "children": [1]},
        {"name": "leaf", "mesh": 0, "scale": [2, 3, 4], "translation": [1, 0, 0]},
    ]
    mesh = one(meshes(write_gltf(tmp_path / "a.glb", [{}], nodes=nodes)))
    np.testing.assert_array_equal(mesh.positions, np.array(TRIANGLE) * (2, 3, 4) + (1, 0, 10))
    assert mesh.name == "leaf"


def test_a_mirrored_node_keeps_its_front(tmp_path):
    nodes = [{"name": "plain", "mesh": 0}, {"name": "mirrored", "mesh": 0, **MIRROR}]
    plain, mirrored = meshes(write_gltf(tmp_path / "a.glb", [{}], nodes=nodes))
    for mesh in (plain, mirrored):
        a, b, c = mesh.positions[mesh.faces[0]]
        assert np.cross(b - a, c - a)[2] == 1
    np.testing.assert_array_equal(mirrored.positions[0], (5, 0, 0))


def test_nodes_of_a_trimesh_scene_keep_their_names_and_colours():
    box, ball = trimesh.creation.box(), trimesh.creation.icosphere()
    box.visual.face_colors, ball.visual.vertex_colors = (255, 0, 0, 51), (0, 255, 0, 102)
    scene = trimesh.Scene()
    scene.add_geometry(box, node_name="box")
    scene.add_geometry(ball, node_name="ball", transform=np.diag([1e-3, 1e-3, 1e-3, 1.0]))
    first, second = meshes(scene)
    assert [(m.name, m.color_mode) for m in (first, second)] == [("box", "face"), ("ball", "vertex")]
    np.testing.assert_allclose(np.linalg.norm(second.positions, axis=1), 1e-3)


def test_transform_comes_after_the_nodes_own(tmp_path):
    nodes = [{"mesh": 0, "translation": [1, 0, 0]}]
    twice = np.diag([2.0, 2, 2, 1])
    mesh = one(meshes(write_gltf(tmp_path / "a.glb", [{}], nodes=nodes), transform=twice))
    np.testing.assert_array_equal(mesh.positions, 2 * (np.array(TRIANGLE) + (1, 0, 0)))


def test_two_mirrors_make_no_mirror(tmp_path):
    path = write_gltf(tmp_path / "a.glb", [{}], nodes=[{"mesh": 0, **MIRROR}])
    mesh = one(meshes(path, transform=np.diag([-1.0, 1, 1, 1])))
    np.testing.assert_array_equal(mesh.faces, [(0, 1, 2)])


def test_cull_is_passed_on():
    assert one(meshes(trimesh.creation.box(), cull="back")).cull == "back"


# shading


def test_shade_of_a_file_uses_its_normals_turned_with_the_node(tmp_path):
    normals = attribute([(0, 0, 1), (1, 0, 1), (0, 1, 0)])
    node = {"mesh": 0, "rotation": [0, 0.5**0.5, 0, 0.5**0.5], "scale": [2, 1, 1]}  # x to −z, z to x
    path = write_gltf(tmp_path / "a.glb", [{"NORMAL": normals}], nodes=[node])
    mesh = one(meshes(path, shade=(1, 0, 0)))
    np.testing.assert_allclose(mesh.colors[:, 0], [1, 0.35 + 0.65 * 2 / 5**0.5, 0.35], rtol=1e-6)


def test_shade_true_lights_from_above_left():
    floor = trimesh.Trimesh(np.array(TRIANGLE)[:, [0, 2, 1]], [(0, 1, 2)])
    mesh = one(meshes(floor, color=(1, 1, 1, 0.5), shade=True))
    np.testing.assert_allclose(mesh.colors[:, 0], 0.35 + 0.65 * 0.8 / np.linalg.norm([0.4, 0.8, 0.6]), rtol=1e-6)


def test_a_directory_is_said_to_be_one(tmp_path):
    with pytest.raises(ab.SceneError, match=f"'{tmp_path}' is a directory"):
        ab.Scene(tmp_path)


def test_a_path_may_begin_with_the_home_directory(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    trimesh.creation.box().export(tmp_path / "box.ply")
    assert ab.Scene("~/box.ply").triangle_count == 12
