"""Plots of comparisons and of lists: what they draw is what the rows and lists say."""

import numpy as np
import pytest

import abuffer as ab
from abuffer import ParameterError
from abuffer._methods import METHODS
from abuffer.comparing import plots
from abuffer.comparing.metrics import FLOOR
from abuffer.own_methods import BUILT_IN

figures = pytest.importorskip("matplotlib.figure", reason="pip install 'abuffer[compare]'")
PathCollection = pytest.importorskip("matplotlib.collections").PathCollection

SIZE = {"width": 48, "height": 36}


@pytest.fixture(scope="module")
def compared():
    scenes = [ab.scenes.cyclic(), ab.scenes.random_triangles(n=60)]
    methods = ["exact", "wboit", "additive"]
    return ab.compare(
        scenes, **SIZE, devices=["cpu"], repeats=2, warmup=3, methods=methods, sweep={"mlab": {"k": [1, 2, 4]}}
    )


def scattered(ax):
    """Dots, in the order of the rows."""
    return [each for each in ax.collections if isinstance(each, PathCollection)]


def dots(ax):
    return np.array([each.get_offsets()[0] for each in scattered(ax)])


def staircase(ax):
    (line,) = [line for line in ax.lines if line.get_drawstyle() == "steps-post"]
    return line.get_xydata()


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


def test_what_is_no_number_is_masked_and_said(compared):
    image = compared.rendered["cyclic", "cpu", "additive"]
    kept = image[3, 4].copy()
    image[3, 4, 1] = np.nan
    try:
        figure = compared.images("cyclic", labels=["additive"])
    finally:
        image[3, 4] = kept
    titles = [ax.get_title() for ax in figure.axes]
    assert any("not finite in 1 pixels" in title for title in titles)
    (off,) = [image for ax in figure.axes for image in ax.images if image.get_cmap().name == "RdBu_r"]
    assert np.argwhere(np.ma.getmaskarray(off.get_array())).tolist() == [[3, 4]]
    shown = next(ax.images[0].get_array() for ax in figure.axes if ax.get_title() == "additive")
    np.testing.assert_array_equal(shown[3, 4], (1, 0, 1))


@pytest.mark.parametrize(("srgb", "grey"), [(False, 0.5), (True, 0.735357)])
def test_images_are_shown_as_they_are_unless_encoding_is_asked_for(srgb, grey):
    sheet = ab.Mesh([[-30, -30, 0], [30, -30, 0], [0, 60, 0]], colors=(0.5, 0.5, 0.5, 1))
    found = ab.compare(sheet, **SIZE, devices=["cpu"], repeats=1, methods=["exact"])
    shown = found.images(srgb=srgb).axes[0].images[0].get_array()
    np.testing.assert_allclose(shown[18, 24], grey, atol=1e-5)


def row(label, time, rmse, **changes):
    times = {f"wall_ms{which}": time for which in ("", "_q1", "_q3")} | {"gpu_ms": float("nan")}
    what = {"label": label, "scene": "s", "device": "d", "rmse": rmse, "failure": "", "curve": None}
    return what | {"method": "exact", "pipeline": "tiles", "bytes_per_pixel": 0.0} | times | changes


def test_the_staircase_goes_through_the_fastest_at_each_error_and_dots_of_the_best_have_an_edge():
    rows = [row("fast", 1.0, 0.1), row("good", 4.0, 0.01), row("bad", 5.0, 0.2)]
    ax = ab.Comparison(rows, {}).plot().axes[0]
    assert staircase(ax).tolist() == [[1.0, 0.1], [4.0, 0.01]]
    edges = [each.get_edgecolor()[0].tolist() for each in scattered(ax)]
    black, white = [0, 0, 0, 1], [1, 1, 1, 1]
    assert edges == [black, black, white]
    weights = {text.get_text(): text.get_weight() for text in ax.texts}
    assert weights == {"fast": "bold", "good": "bold", "bad": "normal"}


def test_a_dots_area_grows_with_the_root_of_bytes():
    rows = [
        row("none", 1.0, 0.1),
        row("some", 2.0, 0.1, bytes_per_pixel=16.0),
        row("unsaid", 3.0, 0.1, bytes_per_pixel=float("nan")),
    ]
    ax = ab.Comparison(rows, {}).plot().axes[0]
    assert [each.get_sizes()[0] for each in scattered(ax)] == [24, 24 + 9 * 4, 24]


@pytest.mark.parametrize("count", [3, 40])
def test_labels_and_legend_are_inside_and_on_nothing_else(count):
    """Labels of few rows; of many, a legend of methods, whatever the figure's width."""
    methods = list(METHODS)
    rng = np.random.default_rng(1)
    rows = [
        row(f"row {i}", t, e, method=methods[i % len(methods)])
        for i, (t, e) in enumerate(rng.uniform(0.01, 1, (count, 2)))
    ]
    figure = ab.Comparison(rows, {}).plot()
    figure.draw_without_rendering()
    whole, legend = figure.bbox, figure.legends[0].get_window_extent()
    assert whole.x0 <= legend.x0 and legend.x1 <= whole.x1 and whole.y0 <= legend.y0
    told = {text.get_text() for text in figure.legends[0].get_texts()}
    assert told >= {"undominated", "larger: more bytes a pixel"}
    assert (set(methods) <= told) == (count > 16)
    (ax,) = figure.axes
    boxes = [text.get_window_extent() for text in ax.texts]
    assert len(boxes) == (count if count <= 16 else len(staircase(ax)))  # none of these is labelled exact
    places = ax.transData.transform(dots(ax))
    for i, box in enumerate(boxes):
        assert ax.bbox.x0 <= box.x0 and box.x1 <= ax.bbox.x1 and ax.bbox.y0 <= box.y0 and box.y1 <= ax.bbox.y1
        assert not any(box.overlaps(other) for other in boxes[:i])
        assert not any(box.contains(*place) for place in places)


def test_what_is_undominated_has_an_edge_off_the_staircase_too():
    """As fast and more off, it is not told apart, and is on no step."""
    rows = [row("step", 1.0, 0.1), row("beside", 1.0, 0.5)]
    ax = ab.Comparison(rows, {}).plot().axes[0]
    assert len(staircase(ax)) == 1
    assert [each.get_edgecolor()[0].tolist() for each in scattered(ax)] == [[0, 0, 0, 1]] * 2


def test_labels_stay_off_large_dots_and_lead_to_far_ones():
    rows = [row(f"dot {i}", 1.0 + i / 1e4, 0.1, bytes_per_pixel=768.0) for i in range(6)]
    figure = ab.Comparison(rows, {}).plot()
    (ax,) = figure.axes
    (x, y), radius = ax.transData.transform(dots(ax)[0]), np.sqrt(24 + 9 * np.sqrt(768)) / 2 * figure.dpi / 72
    for text in ax.texts:
        box = text.get_window_extent()
        assert box.x0 >= x + radius or box.x1 <= x - radius or box.y0 >= y + radius or box.y1 <= y - radius
    # The first two stand at the dot's height, on its right and left; to those that are far lines lead.
    lines = [line for line in ax.lines if line.get_linewidth() == 0.4]
    assert 1 <= len(lines) <= 4
    assert all(np.isclose(line.get_xydata()[0], dots(ax), rtol=1e-5).all(axis=1).any() for line in lines)


def test_a_long_label_is_cut_and_leaves_the_axes_as_wide():
    widths = []
    for label in ("short", "long " * 40):
        figure = ab.Comparison([row(label, 1.0, 0.1), row("b", 2.0, 0.2)], {}).plot()
        figure.draw_without_rendering()
        widths.append(figure.axes[0].get_window_extent().width)
    assert widths[0] == pytest.approx(widths[1], abs=2)
    assert [len(text.get_text()) for text in figure.axes[0].texts] == [40, 1]


def test_of_many_rows_on_the_staircase_some_have_labels():
    rows = [row(f"row {i}", 1.0 + i, 0.5**i) for i in range(18)] + [row("exact", 99.0, 0.0)]
    told = [text.get_text() for text in ab.Comparison(rows, {}).plot().axes[0].texts]
    assert len(told) == 17 and "exact" in told


@pytest.mark.parametrize("part", [False, True])
def test_axes_of_a_figure_and_of_a_part_of_one_are_drawn_into(part):
    figure = figures.Figure(layout="constrained")
    parent = figure.subfigures(1, 2)[0] if part else figure
    ax = parent.subplots()
    assert ab.Comparison([row("a", 1.0, 0.1)], {}).plot(ax) is parent
    figure.draw_without_rendering()
    legend = ax.get_legend().get_window_extent()
    assert figure.bbox.y0 <= legend.y0 and legend.y1 <= ax.get_window_extent().y0


@pytest.mark.parametrize("projection", ["polar", "3d"])
def test_axes_that_are_not_flat_are_refused(projection):
    ax = figures.Figure().add_subplot(projection=projection)
    with pytest.raises(ParameterError, match="flat axes"):
        ab.Comparison([row("a", 1.0, 0.1)], {}).plot(ax)


def test_the_kind_of_reference_is_in_the_pictures_title():
    found = ab.compare(ab.scenes.cyclic(), **SIZE, devices=["cpu"], repeats=1, methods=["exact"], reference="fragments")
    assert found.images().axes[0].get_title() == "cyclic: reference, fragments"
    with pytest.raises(ParameterError, match=r"give \['exact'\]"):
        found.images(labels="exact")


def test_a_method_has_the_same_colour_in_every_figure(compared):
    alone = ab.Comparison([row("x", 1.0, 0.1, method="additive")], {}).plot().axes[0]
    scene = compared.plot(scene="cyclic").axes[0]
    place = [each["label"] for each in compared.select(scene="cyclic")].index("additive")
    colors = scattered(scene)[place].get_facecolor(), scattered(alone)[0].get_facecolor()
    assert colors[0].tolist() == colors[1].tolist()
    assert len({tuple(plots._color(method)) for method in BUILT_IN}) == len(BUILT_IN)


def test_dollars_are_dollars():
    figure = ab.Comparison([row(r"$\frac{$ a$b$c", 1.0, 0.1, scene="$s$")], {}).plot()
    figure.draw_without_rendering()
    assert figure.axes[0].get_title() == "$s$, d"


def test_what_has_no_time_is_not_drawn():
    nan = float("nan")
    figure = ab.Comparison([row("untimed", nan, 0.1), row("timed", 1.0, 0.1)], {}).plot()
    assert [text.get_text() for text in figure.axes[0].texts] == ["timed"]
    assert isinstance(ab.Comparison([row("untimed", nan, 0.1)], {}).plot(), figures.Figure)


def test_nothing_cannot_be_plotted():
    for draw in (ab.Comparison([], {}).plot, ab.Comparison([], {}).images):
        with pytest.raises(ParameterError, match="the comparison has no rows"):
            draw()


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


def test_of_other_modes_a_pixels_plot_claims_no_transmittance():
    glow = ab.Mesh([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], colors=(1, 0, 0, 0.5), blend="additive")
    frags = ab.render(glow, ab.Camera.look_at((0, 0, 4), (0, 0, 0)), **SIZE, device="cpu", fragments=True).fragments
    said = [text.get_text() for text in frags.plot(18, 24).axes[0].texts]
    assert "additive" in said[0] and "T" not in said[0].replace("Tα", "T")
    assert "no single number" in said[1]


def test_of_masks_of_samples_a_pixels_plot_claims_no_transmittance():
    sheet = ab.Mesh([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], colors=(1, 0, 0, 0.5))
    camera = ab.Camera.look_at((0, 0, 4), (0, 0, 0))
    frags = ab.render(sheet, camera, **SIZE, device="cpu", fragments=True, samples=4).fragments
    assert "no single number" in frags.plot(18, 24).axes[0].texts[-1].get_text()


def test_of_deep_pixels_the_nearest_layers_are_plotted():
    s = ab.scenes.thin_sheets(n=100)
    frags = ab.render(s.scene, s.camera, width=20, height=15, device="cpu", fragments=True).fragments
    figure = frags.plot(7, 10)
    said = [text.get_text() for text in figure.axes[0].texts]
    assert len(said) == 65 and said[-1].startswith("… 36 more, the farthest; lets ")
    assert figure.get_figheight() < 30


@pytest.mark.parametrize(("srgb", "grey"), [(False, 0.5), (True, 0.735357)])
def test_a_layers_colour_is_shown_over_checks_and_at_the_end_opaque(srgb, grey):
    sheet = ab.Mesh([(-9, -9, 0), (9, -9, 0), (0, 9, 0)], colors=(0.5, 0.5, 0.5, 0.25))
    frags = ab.render(sheet, ab.Camera.look_at((0, 0, 4), (0, 0, 0)), **SIZE, device="cpu", fragments=True).fragments
    shown = np.asarray(frags.plot(18, 24, srgb=srgb).axes[0].images[0].get_array())
    np.testing.assert_allclose(shown[:, -2:], grey, atol=1e-5)
    np.testing.assert_allclose(shown[0, 0], 0.25 * grey + 0.75 * 0.5, atol=1e-5)
    np.testing.assert_allclose(shown[0, 1], 0.25 * grey + 0.75 * 0.75, atol=1e-5)
