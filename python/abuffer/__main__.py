"""The command line: ``python -m abuffer``, or ``abuffer``."""

import argparse
import contextlib
import json
import sys
import threading
import warnings
from pathlib import Path

import abuffer as ab
from abuffer import bench

LONG = 1.0  # seconds after which work says that it is going on


def main(argv=None) -> int:
    """Runs one command and returns its exit status: 0; 2 for a wrong argument or scene; 130 after Ctrl-C; else 1.

    Args:
        argv: list of str. None: the process's own.
    """
    arguments = _parser().parse_args(argv)
    with warnings.catch_warnings():
        warnings.showwarning = lambda message, *_, **__: print(f"abuffer: warning: {message}", file=sys.stderr)
        try:
            arguments.run(arguments)
        except (ab.ParameterError, ab.SceneError) as e:
            return _failed(e, 2)
        except (ab.AbufferError, OSError) as e:
            return _failed(e, 1)
        except KeyboardInterrupt:
            return 130
    return 0


def _parser():
    parser = argparse.ArgumentParser(
        prog="abuffer", description="Renders translucent models exactly, whatever order their triangles come in."
    )
    parser.add_argument("--version", action="version", version=f"abuffer {ab.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    render = commands.add_parser("render", help="render models into one image", description="Renders models.")
    render.set_defaults(run=_render)
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

    timing = commands.add_parser(
        "bench",
        help="time the pipelines of a GPU against each other",
        description="Times pipelines tiles and linked_list on one device, in turns: an image alone, lists, 4 samples a pixel, "
        "and a blend mode, of few large triangles (200) and many small ones (200,000). Below 1 tiles are faster. The first "
        "renders take seconds to compile.",
    )
    timing.set_defaults(run=_bench)
    timing.add_argument("--device", default="gpu", help="gpu (the best adapter, the default) or part of a name")
    timing.add_argument("--repeats", type=int, default=9, metavar="N", help="renders of each (default: 9)")
    timing.add_argument(
        "--calibrate",
        action="store_true",
        help="print the row that pipeline auto chooses by, for python/abuffer/measured.py",
    )

    devices = commands.add_parser("devices", help="print the devices that can render", description="Prints devices.")
    devices.set_defaults(run=lambda _: print(ab.devices()))
    pipelines = commands.add_parser("pipelines", help="print the pipelines", description="Prints pipelines.")
    pipelines.set_defaults(run=lambda _: print(ab.pipelines()))
    methods = commands.add_parser("methods", help="print the methods", description="Prints methods.")
    methods.set_defaults(run=lambda _: print(ab.methods()))
    return parser


def _render(given):
    # What is known to fail at the end had better fail at once.
    output = _writable("--output", given.output, (".png", ".npz"))
    lists = given.fragments and _writable("--fragments", given.fragments, (".npz",))
    background = _numbers("--background", given.background)
    color = None if given.color is None else _numbers("--color", given.color)
    up = _numbers("--up", given.up)
    opaque, blend = given.opaque or None, given.blend
    if blend not in (None, "over"):
        if opaque:
            raise ab.ParameterError(f"--opaque surfaces are not blended: leave it out, or leave out --blend {blend}")
        opaque = False  # materials of a glTF are opaque unless they say otherwise
    with _status("rendering"):
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


def _bench(given):
    if given.repeats < 1:
        raise ab.ParameterError(f"--repeats must be at least 1, got {given.repeats}")
    rows = []
    header = f"{'case':<9}{'triangles':<11}{'tiles, ms':>11}{'linked_list, ms':>17}{'tiles ÷ linked_list':>21}"
    with _status("rendering"):
        for row in bench.compare(given.device, given.repeats):
            if not rows:
                print(header)
            rows.append(row)
            start = f"{row['case']:<9}{row['scene']:<11}"
            if "error" in row:
                print(start + row["error"], flush=True)
            else:
                print(f"{start}{row['tiles_ms']:>11.2f}{row['linked_list_ms']:>17.2f}{row['ratio']:>21.2f}", flush=True)
    if given.calibrate:
        print(json.dumps(bench.constants(rows), indent=4))


def _writable(option, path, suffixes):
    path = Path(path)
    if path.suffix not in suffixes:
        raise ab.ParameterError(f"{option} must end in {' or '.join(suffixes)}, got {str(path)!r}")
    if not path.parent.is_dir():
        raise ab.ParameterError(f"{option} is in {str(path.parent)!r}, which is not a directory")
    return path


def _numbers(option, text):
    """ "r,g,b" as numbers; how many there may be is for the library to say."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        raise ab.ParameterError(f"{option} must be numbers such as 1,1,1, got {text!r}") from None
    return numbers[0] if len(numbers) == 1 else numbers


@contextlib.contextmanager
def _status(text):
    """Shows `text` on a terminal while the block runs long; nothing without rich, or if it is short."""
    try:
        from rich.console import Console
    except ImportError:
        yield
        return
    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    status = console.status(f"{text} …")
    timer = threading.Timer(LONG, status.start)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # else it might start after the stop
        status.stop()


def _failed(error, status):
    print(f"abuffer: error: {' '.join(str(error).split())}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
