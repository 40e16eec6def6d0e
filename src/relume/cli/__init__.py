"""The command line: one module a command, each imported only when its command is given."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence

import relume.cluster as machines

COMMANDS = {
    "info": "Print what a picture, a map or a mesh holds, or what this machine renders with.",
    "merge": "Merge differently exposed photographs into one radiance map.",
    "probe": "Turn photographs of a mirrored ball into an environment map.",
    "panorama": "Stitch perspective photographs into an environment map.",
    "convert": "Convert pictures between formats, environment maps between mappings; turn maps, lay them out for "
    "programs.",
    "model": "Model a place from edges marked in photographs: cameras and blocks, found together.",
    "edit": "Edit radiance maps in linear light, or through any painting program.",
    "sky": "Make the light of a clear day: sky and sun by place, date and hour, in cd/m².",
    "sun": "Recover a sun that clipped, from a grey ball or a chart in the same light.",
    "lights": "Turn an environment map into lights for other programs: light constellations, the sun, the rest.",
    "reflect": "Turn an environment map into reflection maps, cubes for game engines and a contact sheet.",
    "stage": "Light stages: a real thing, photographed under one light at a time, under any light.",
    "render": "Render a scene or a mesh under an environment map: a picture, frames or a movie.",
    "film": "Make a film of a scene file: frames, lens and film stock, and the movie.",
    "insert": "Insert objects into a photograph, lit by the light photographed there.",
    "view": "Show pictures and maps in the browser, with their values, errors and differences.",
    "studio": "Make a composite by looking and pointing: a shot and its photographs in the browser.",
    "develop": "Develop radiance into a picture: lens, glare, film or tone, display; and back.",
    "demo": "Run the main job on the example room and say where the pictures are.",
}

FOLDERS = {
    "model": "light.", "sky": "light.", "sun": "light.", "stage": "stage.", "view": "pages.", "studio": "pages.",
    "render": "rendering.", "reflect": "rendering.", "film": "rendering.",
}  # fmt: skip
"""Where a command's module is, if not beside this one."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code: 0 done, 2 bad input, 3 output could not be written, 4 done but doubtful,
    or some of many failed, 130 interrupted by Ctrl-C, 128 and the signal's number by another one.

    arguments : the words after `relume`; this process's own unless given, which then ends with the command
    """
    if arguments is None:
        machines.runs_one_command()
    from cyclopts import App, CycloptsError

    from relume.cli import console

    app = App(
        name="relume",
        help="Photographs in, light out; light in, photographs out.",
        version=console.version,
        help_epilogue="`relume COMMAND --help` shows each command's options. Angles are degrees, lengths metres.",
        suppress_keyboard_interrupt=False,  # cyclopts would end without a word
    )
    for name, help_text in COMMANDS.items():
        module = f"relume.cli.{FOLDERS.get(name, '')}{name}"
        app.command(f"{module}:{name}", name=name, help=help_text)
    words = list(sys.argv[1:] if arguments is None else arguments)
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        # Where it has few letters, as Windows' pipes, − is written as \\u2212; a name stays one that can be read back.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        app(words, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except CycloptsError as error:
        return console.refuse(
            str(error).strip() or "wrong arguments", 2, hint=f"see {' '.join(('relume', *_command(words)))} --help"
        )
    except BrokenPipeError:  # of a reader that has seen enough, like head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except KeyboardInterrupt:
        return console.refuse("interrupted; give the same command again, and what is kept will be used", 130)
    except Exception as error:
        return console.refuse_error(error, verbose="-v" in words or "--verbose" in words)
    return 0


def _command(words: Sequence[str]) -> list[str]:
    """The words that name a command, like stage relight."""
    if words[:1] == ["stage"]:
        from relume.cli.stage.stage import COMMANDS as STAGE

        return [*words[:1], *(word for word in words[1:2] if word in STAGE)]
    return [word for word in words[:1] if word in COMMANDS]
