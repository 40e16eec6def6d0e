"""`relume lights`: an environment map in, or a folder of them, lights for other programs out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Group, Parameter
from cyclopts.validators import Number

import relume as rl
from relume.cli.arguments import Clamp, DryRun, From, MapFile, mapping_of, require_files, require_suffix
from relume.cli.console import OutputOptions, finish, note, print_facts, warnings_as_notes
from relume.cli.option_types import Point, numbers

PLACES = Group("Lights that have a place")
Corners = tuple[float, float, float, float, float, float]
LightsOut = Annotated[
    list[Path],
    Parameter(
        alias="-o",
        negative="",
        help="The file to write, again for each: .json, .usda (USD), .gltf, .py (Blender), .rad (Radiance), .xml "
        "(Mitsuba). Of a folder of maps one for each map, numbered.",
    ),
]


@Parameter(name="*")
@dataclass(frozen=True)
class Places:
    """Where lights stand, in metres, +Y up."""

    at: Annotated[Point | None, Parameter(group=PLACES, help="Where the map was taken, in metres, +Y up.")] = None
    box: Annotated[
        Corners | None,
        numbers("X,Y,Z,X,Y,Z", like="-2,0,-3,2,2.7,3"),
        Parameter(
            group=PLACES,
            help="The room that --at is in, from its lowest corner to its highest: the lights stand where their rays "
            "meet its walls.",
        ),
    ] = None
    distant: Annotated[
        list[int] | None,
        Parameter(
            group=PLACES,
            negative="",
            help="With --box: the number of a light that stays distant, like the sun through a window; the strongest, "
            "and with --sun the strongest sun, is 0. May repeat.",
        ),
    ] = None
    second: Annotated[
        Path | None,
        Parameter(
            group=PLACES,
            help="A map taken at another place: --sun lamps that both maps show stand where their rays meet; lamps far "
            "away, or in one map only, stay distant.",
        ),
    ] = None
    second_at: Annotated[Point | None, Parameter(group=PLACES, help="Where the second map was taken.")] = None

    def room(self) -> rl.light.Room | None:
        """The room of --box; refuses options about places that do not belong together."""
        if self.at is None:
            given = {"--box": self.box, "--second": self.second, "--second-at": self.second_at}
            for option, value in {**given, "--distant": self.distant}.items():
                if value is not None:
                    raise ValueError(f"{option} is for lights that have a place; say where the map was taken with --at")
            return None
        if (self.box is None) == (self.second is None):
            raise ValueError("--at places lights by a room's --box or by a --second map; give one of them")
        if (self.second is None) != (self.second_at is None):
            raise ValueError("--second and --second-at belong together: a map, and where it was taken")
        if self.box is not None:
            return rl.light.Room(self.at, self.box[:3], self.box[3:], tuple(self.distant or ()))
        if self.distant is not None:
            raise ValueError("--distant is for --box; with --second what is far stays distant by itself")
        return None

    def second_probe(self, mapping: rl.mappings.Mapping | None, *, clamp: bool) -> rl.light.SecondProbe | None:
        """The map of --second, read."""
        if self.second is None or self.at is None or self.second_at is None:
            return None
        light = rl.read_environment(self.second, mapping, clamp=clamp)
        return rl.light.SecondProbe(light, self.at, self.second_at, str(self.second))


def lights(
    light_map: MapFile,
    /,
    *,
    out: LightsOut,
    format: Annotated[
        Literal["json", "usd", "gltf", "blender", "radiance", "mitsuba"] | None,
        Parameter(help="The program to write for, whatever the file's suffix; for a single -o."),
    ] = None,
    count: Annotated[
        int | None,
        Parameter(
            validator=Number(gte=1, lte=65536),
            help="Lights in all, at most; 64 unless given; with --sun and --residual the suns alone.",
        ),
    ] = None,
    method: Annotated[
        Literal["median-cut", "variance", "k-means"],
        Parameter(
            help="How the sphere is divided. median-cut: the quickest; variance: bright sources stay whole; k-means: "
            "the least error."
        ),
    ] = "median-cut",
    sun: Annotated[
        list[int] | None,
        Parameter(
            negative="",
            consume_multiple=(0, 1),
            help="Take the sun out first, or this many compact lamps. Write it after the map.",
        ),
    ] = None,
    residual: Annotated[
        Path | None,
        Parameter(help="Keep what is not bright in a lat-long map, .exr or .hdr, that the files name as background."),
    ] = None,
    contrast: Annotated[
        float | None,
        Parameter(help="With --residual: it is nowhere brighter than so many times its own mean; 4 unless given."),
    ] = None,
    soft: Annotated[
        bool, Parameter(negative="", help="Give each light the apparent diameter of the light it stands for.")
    ] = False,
    picture: Annotated[Path | None, Parameter(help="Draw the map with its regions and lights, .png.")] = None,
    places: Places = Places(),
    from_: From = None,
    clamp: Clamp = False,
    accept: Annotated[bool, Parameter(negative="", help="Exit with 0 although light of the map is clipped.")] = False,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Turn an environment map into lights that carry all of its light, for renderers that cannot use such maps.

    Of a folder of maps, as of a film, the same lights follow the light from map to map, in a file for each.
    """
    with warnings_as_notes(output):
        # Everything that can be refused is refused before any work.
        require_files([*([] if light_map.is_dir() else [light_map]), *([places.second] if places.second else [])])
        to = rl.LightFiles(tuple(out), residual, format)
        for path in out:
            require_suffix(path, path.suffix.lower())
        if residual is not None:
            require_suffix(residual, ".exr", ".hdr", option="--residual")
        if picture is not None:
            require_suffix(picture, ".png", option="--picture")
        # What is asked for.
        mapping = mapping_of(from_)
        methods = {"variance": rl.light.VarianceMinimisation, "k-means": rl.light.KMeans}
        settings = rl.light.LightSettings(
            count=count,
            method=methods.get(method, rl.light.MedianCut)(),
            suns=None if sun is None else (sun[0] if sun else 1),
            residual=residual is not None,
            contrast=contrast,
            soft=soft,
            room=places.room(),
        )
        if light_map.is_dir():
            sequence = rl.light.LightSequence.found(light_map.absolute(), mapping=mapping, clamp=clamp)
            _over_time(sequence, settings, to, picture, places, accept, dry_run, output)
            return
        light = rl.read_environment(light_map, mapping, clamp=clamp)
        settings = replace(settings, second=places.second_probe(mapping, clamp=clamp))
        written = [*out, *([residual] if residual else []), *([picture] if picture else [])]
        if dry_run:
            print_facts(output, {"would write": [str(path) for path in written], "from": light.mapping.name})
            return

        # The lights, their files and a picture of them.
        made = rl.light.make_lights(light, settings, str(light_map))
        note(output, *made.notes, *rl.write_lights(made, to))
        number = len(made.lights.directions)
        if picture is not None:
            rl.report.draw_lights(picture, made, f"{light_map.name}: {number} lights, {method}")
        facts = {"written": [str(path) for path in written], "lights": number, "method": method, "unit": light.unit}
        print_facts(output, facts | made.facts())
        finish(output, made.doubts, accept=accept)


def _over_time(
    maps: rl.light.LightSequence, settings: rl.light.LightSettings, to: rl.LightFiles, picture: Path | None,
    places: Places, accept: bool, dry_run: bool, output: OutputOptions,
) -> None:  # fmt: skip
    """Write the lights of every map of a folder, in files with its number."""
    if picture is not None or places.second is not None:
        raise ValueError("--picture and --second are of a single map; leave them out for a folder of maps")
    count, doubts = len(maps.paths), list[str]()
    names = [[path.with_stem(f"{path.stem}_{number:06d}") for path in to.paths] for number in range(1, count + 1)]
    if dry_run:
        print_facts(output, {"would write": [str(path) for path in names[0] + names[-1]], "maps": count})
        return
    lights = 0
    for made, paths in zip(rl.light.follow_lights(maps, settings), names, strict=True):
        rl.write_lights(made, replace(to, paths=tuple(paths)))
        lights, doubts = len(made.lights.directions), [*doubts, *made.doubts]
    print_facts(output, {"written": [str(path) for path in names[0] + names[-1]], "maps": count, "lights": lights})
    finish(output, doubts, accept=accept)
