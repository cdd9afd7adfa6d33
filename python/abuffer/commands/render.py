"""`abuffer render`."""

import abuffer as ab

from .arguments import numbers, writable
from .progress import status


def add(commands):
    render = commands.add_parser("render", help="render models into one image", description="Renders models.")
    render.set_defaults(run=_run)
    add = render.add_argument
    add("models", nargs="+", metavar="MODEL", help="PLY, OBJ, STL, OFF, GLB or glTF file")
    add("-o", "--output", required=True, metavar="FILE", help=".png, or .npz with everything that was computed")
    add("--fragments", metavar="FILE", help=".npz for the fragment lists")
    add("--plan", action="store_true", help="print what was chosen, and why")

    look = render.add_argument_group("look")
    add = look.add_argument
    add("--alpha", type=float, metavar="A", help="multiplies the models' alpha, 0 to 1")
    add("--color", metavar="COLOR", help="r,g,b or r,g,b,a, 0 to 1, instead of the models' own")
    add("--opaque", action="store_true", help="draw the models opaque")
    add(
        "--blend",
        metavar="MODE",
        help=f"{', '.join(ab.BLENDS[:-1])} or {ab.BLENDS[-1]}, for all models (default: over); "
        "any but over makes opaque models translucent",
    )
    add("--shade", action="store_true", help="Lambert shading")
    add(
        "--background", default="0,0,0,0", metavar="COLOR", help="grey, r,g,b or r,g,b,a, 0 to 1 (default: transparent)"
    )
    add("--azimuth", type=float, default=30.0, metavar="DEGREES", help="of the eye around up (default: 30)")
    add("--elevation", type=float, default=20.0, metavar="DEGREES", help="of the eye over the horizon (default: 20)")
    add("--up", default="0,1,0", metavar="X,Y,Z", help="the models' up, --up=0,0,1 where it is Z (default: 0,1,0)")
    add("--fov", type=float, default=45.0, metavar="DEGREES", help="vertical field of view (default: 45)")
    add("--width", type=int, metavar="PIXELS", help="with --height (default: 640x480)")
    add("--height", type=int, metavar="PIXELS")

    how = render.add_argument_group("how it is computed")
    add = how.add_argument
    add("--method", default="exact", help="see `abuffer methods` (default: exact)")
    add("--pipeline", default="auto", help="see `abuffer pipelines`, or auto (default)")
    add(
        "--device",
        default="auto",
        help="cpu, gpu (the best adapter), part of a name that `abuffer devices` prints, or auto (default)",
    )
    add("--samples", type=int, default=1, metavar="N", help="samples a pixel: 1 (default), 2, 4, 8 or 16 smooth edges")
    add("--precision", default="float32", help="float32 (default) or float64")
    add("--memory", metavar="BYTES", help='limit for lists and scratch, such as "2GiB"')


def _run(given):
    # What is known to fail at the end had better fail at once.
    output = writable("--output", given.output, (".png", ".npz"))
    lists = given.fragments and writable("--fragments", given.fragments, (".npz",))
    background = numbers("--background", given.background)
    color = None if given.color is None else numbers("--color", given.color)
    up = numbers("--up", given.up)
    opaque, blend = given.opaque or None, given.blend
    if blend not in (None, "over"):
        if opaque:
            raise ab.ParameterError(f"--opaque surfaces are not blended: leave it out, or leave out --blend {blend}")
        opaque = False  # materials of a glTF are opaque unless they say otherwise
    with status("rendering"):
        scene = ab.Scene()
        for model in given.models:
            scene.add(model, color=color, alpha=given.alpha, blend=blend, opaque=opaque, shade=given.shade)
        frame = ab.render(
            scene,
            ab.Camera.fit(scene, azimuth=given.azimuth, elevation=given.elevation, up=up, fov_y=given.fov),
            width=given.width,
            height=given.height,
            method=given.method,
            pipeline=given.pipeline,
            device=given.device,
            samples=given.samples,
            background=background,
            fragments=lists is not None,
            precision=given.precision,
            memory=given.memory,
        )
        frame.save(output)
        if lists is not None:
            frame.fragments.save(lists)
    height, width = frame.image.shape[:2]
    print(f"{output}: {width}x{height}, {frame.stats}")
    if given.plan:
        print(frame.plan)
