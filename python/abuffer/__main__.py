"""The command line: ``python -m abuffer``, or ``abuffer``."""

import argparse
import sys
import warnings

import abuffer as ab
from abuffer.commands import bench, compare, inspect, render


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
    for command in (render, compare, inspect, bench):
        command.add(commands)
    devices = commands.add_parser("devices", help="print the devices that can render", description="Prints devices.")
    devices.set_defaults(run=lambda _: print(ab.devices()))
    pipelines = commands.add_parser("pipelines", help="print the pipelines", description="Prints pipelines.")
    pipelines.set_defaults(run=lambda _: print(ab.pipelines()))
    methods = commands.add_parser("methods", help="print the methods", description="Prints methods.")
    methods.set_defaults(run=lambda _: print(ab.methods()))
    return parser


def _failed(error, status):
    print(f"abuffer: error: {' '.join(str(error).split())}", file=sys.stderr)
    return status


if __name__ == "__main__":
    sys.exit(main())
