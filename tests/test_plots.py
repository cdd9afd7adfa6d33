"""Plots of comparisons and of lists: what they draw is what the rows and lists say."""

import numpy as np
import pytest

import abuffer as ab
from abuffer import ParameterError
from abuffer.comparing.plots import FLOOR

figures = pytest.importorskip("matplotlib.figure", reason="pip install 'abuffer[compare]'")

SIZE = {"width": 48, "height": 36}


@pytest.fixture(scope="module")
def compared():
    scenes = [ab.scenes.cyclic(), ab.scenes.random_triangles(n=60)]
    methods = ["exact", "wboit", "additive"]
    return ab.compare(
        scenes, **SIZE, devices=["cpu"], repeats=2, warmup=3, methods=methods, sweep={"mlab": {"k": [1, 2, 4]}}
    )


def dots(ax):
    """Where they are, in the order of the rows."""
    return np.array(
        [collection.get_offsets()[0] for collection in ax.collections if len(collection.get_offsets()) == 1]
    )


def test_a_panel_for_each_scene_has_a_dot_for_each_row(compared):
    figure = compared.plot()
    panels = [ax for ax in figure.axes if ax.axison]
    assert [ax.get_title() for ax in panels] == ["cyclic, cpu", "random_triangles, cpu"]
    for ax, scene in zip(panels, compared.scenes, strict=True):
        rows = compared.select(scene=scene)
        wanted = [(row["wall_ms"], max(row["rmse"], FLOOR)) for row in rows]
        found = dots(ax)
        assert {tuple(point) for point in np.round(found, 12)} >= {tuple(point) for point in np.round(wanted, 12)}
        assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
        assert {text.get_text() for text in ax.texts} == {row["label"] for row in rows}


def test_exact_is_drawn_at_the_floor_of_float32(compared):
    rows = compared.select(scene="cyclic", label="exact")
    assert rows[0]["rmse"] < FLOOR
    assert FLOOR in dots(compared.plot(scene="cyclic").axes[0])[:, 1]


def test_a_sweep_is_a_curve_through_its_rows(compared):
    ax = compared.plot(scene="cyclic").axes[0]
    rows = [row for row in compared.select(scene="cyclic") if row["curve"] == "mlab"]
    curves = [line.get_xydata() for line in ax.lines if len(line.get_xydata()) == len(rows)]
    wanted = [(row["wall_ms"], max(row["rmse"], FLOOR)) for row in rows]
    assert any(np.allclose(curve, wanted) for curve in curves)


def test_it_draws_into_axes_that_are_given(compared):
    figure = figures.Figure()
    ax = figure.subplots()
    assert compared.plot(ax, scene="cyclic") is figure
    assert ax.get_title() == "cyclic, cpu"
    with pytest.raises(ParameterError, match="room for one scene and device, and there are 2"):
        compared.plot(ax)
    with pytest.raises(ParameterError, match="there is no scene 'bunny': there are cyclic, random_triangles"):
        compared.plot(scene="bunny")


def test_images_come_with_signed_differences_on_one_scale(compared):
    figure = compared.images("cyclic", labels=["exact", "additive"])
    maps = [image for ax in figure.axes for image in ax.images if image.get_cmap().name == "RdBu_r"]
    assert len(maps) == 2
    assert len({image.get_clim() for image in maps}) == 1
    off = compared.rendered["cyclic", "cpu", "additive"][..., :3] - compared.references["cyclic"][..., :3]
    shown = np.asarray(maps[1].get_array())
    assert np.abs(shown).max() == pytest.approx(np.abs(off).max(), rel=1e-6)
    assert shown.max() > 0.1  # too bright is positive


def test_inspect_counts_pixels_by_their_fragments():
    s = ab.scenes.nested_spheres(n=3)
    frame = ab.render(s.scene, s.camera, **SIZE, device="cpu", fragments=True)
    found = ab.inspect(frame)
    assert found.histogram.sum() == frame.counts.size
    assert (found.histogram * np.arange(len(found.histogram))).sum() == found.fragments == frame.stats.fragments
    assert found.deepest == frame.counts.max() == frame.counts[found.deepest_pixel] == 6
    assert found.covered == (frame.counts > 0).mean()
    assert found.mean == pytest.approx(found.fragments / (frame.counts > 0).sum())
    assert found.percentiles[99.9] <= found.deepest
    assert ab.inspect(frame.fragments).histogram.tolist() == found.histogram.tolist()
    with pytest.raises(ParameterError, match='render with fragments="count"'):
        ab.inspect(ab.render(s.scene, s.camera, **SIZE, device="cpu"))


def test_inspect_of_an_empty_frame_is_zeros():
    away = ab.Camera.look_at((0, 0, 4), (0, 0, 9))
    frame = ab.render(ab.scenes.cyclic().scene, away, **SIZE, device="cpu", fragments="count")
    found = ab.inspect(frame)
    assert (found.fragments, found.deepest, found.covered, found.mean) == (0, 0, 0, 0)
    assert isinstance(found.plot(), figures.Figure)


def test_its_picture_has_a_bar_for_each_number_of_fragments():
    s = ab.scenes.nested_spheres(n=3)
    found = ab.inspect(ab.render(s.scene, s.camera, **SIZE, device="cpu", fragments="count"))
    _, bars, *_ = found.plot().axes
    assert [bar.get_height() for bar in bars.patches] == found.histogram[1:].tolist()
    assert found._repr_png_().startswith(b"\x89PNG")


def test_a_pixels_plot_says_depth_alpha_and_transmittance_of_each_layer():
    mesh = ab.Mesh(
        [[(-9, -9, z), (9, -9, z), (0, 9, z)] for z in (0, 1)],
        colors=[(1, 0, 0, 0.5), (0, 1, 0, 0.25)],
        color_mode="face",
    )
    frags = ab.render(mesh, ab.Camera.look_at((0, 0, 4), (0, 0, 0)), **SIZE, device="cpu", fragments=True).fragments
    said = [text.get_text() for text in frags.plot(18, 24).axes[0].texts]
    assert "depth 3 " in said[0] and "α 0.25 " in said[0] and "T 1 " in said[0] and "primitive 1" in said[0]
    assert "depth 4 " in said[1] and "α 0.5 " in said[1] and "T 0.75 " in said[1] and "Tα 0.375 " in said[1]
    assert said[2] == "lets 0.375 of the background through"
