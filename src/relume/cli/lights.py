"""`relume lights`: an illumination map in, lamps for other programs out: a constellation, the sun, and what is left."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, require_files, require_suffix
from relume.cli.console import OutputOptions, note, print_facts, warnings_as_notes
from relume.cli.light_input import Clamp
from relume.cli.lights_places import Places, by_second, on_walls, read_second
from relume.errors import DoubtfulResult, UnreadableFile

if TYPE_CHECKING:
    import numpy as np

    from relume.export.light_formats import Format
    from relume.light.constellations.constellation import Constellation
    from relume.light.constellations.k_means import Regions
    from relume.light.suns.extraction import Sun
    from relume.sphere.environment_map import EnvironmentMap

COUNT = 64
MOST = 65536
Method = Literal["median-cut", "variance", "k-means"]


def lights(
    light_map: Annotated[Path, Parameter(name="MAP", help="The illumination map, .exr, .hdr or another format.")],
    /,
    *,
    out: Annotated[
        list[Path],
        Parameter(
            alias="-o",
            negative="",
            help="The file to write, again for each: .json, .usda (USD), .gltf, .py (Blender), .rad (Radiance), .xml "
            "(Mitsuba).",
        ),
    ],
    format: Annotated[
        Literal["json", "usd", "gltf", "blender", "radiance", "mitsuba"] | None,
        Parameter(help="What to write whatever the file's suffix, for a single -o."),
    ] = None,
    count: Annotated[
        int | None, Parameter(help="Lights in all, at most; 64 unless given; with --sun and --residual the suns alone.")
    ] = None,
    method: Annotated[
        Method,
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
    from_: Annotated[
        str | None, Parameter(name="--from", help="Mapping of the map where the file does not remember it, as convert.")
    ] = None,
    clamp: Clamp = False,
    accept: Annotated[bool, Parameter(negative="", help="Exit with 0 although light of the map is clipped.")] = False,
    places: Places = Places(),
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Turn an illumination map into parallel lights that carry all of its light, for renderers without such maps."""
    from relume.errors import SunNotFound
    from relume.image import files
    from relume.light.constellations.constellation import irradiance_error
    from relume.sphere.environment_files import as_radiance_map
    from relume.sphere.mappings.mapping import LatLong
    from relume.sphere.mappings.names import mapping_named

    with warnings_as_notes(output):
        require_files([light_map])
        forms = _forms(out, format, residual)
        suns = None if sun is None else (sun[0] if sun else 1)
        _check(count, suns, residual, contrast, picture)
        places.check(suns)
        try:
            mapping = None if from_ is None else mapping_named(from_)
        except ValueError as error:
            raise ValueError(f"--from: {error}") from None
        light = rl.read_environment(light_map, mapping, clamp=clamp)
        if not light.radiance.any():
            raise UnreadableFile(f"{light_map}: black all over; there is no light to make lights of")
        second = read_second(places, light, mapping, clamp)
        written = [*out, *([residual] if residual else []), *([picture] if picture else [])]
        if dry_run:
            print_facts(output, {"would write": [str(path) for path in written], "from": light.mapping.name})
            return
        photographed = light
        if residual is not None and not isinstance(light.mapping, LatLong):
            note(
                output, f"{light_map}: a {light.mapping.name} map, resampled to lat-long, which the residual has to be"
            )
            light = light.remapped(LatLong(), light.matching_size(LatLong()))
        try:
            found, rest, made = _divided(light, count, suns, residual is not None, contrast, _method(method))
        except SunNotFound as error:
            raise SunNotFound(f"{light_map}: {error}") from None
        if suns is not None and len(found) < suns:
            note(output, f"--sun {suns}: {len(found)} stand out; the light of others stays with the rest")
        angles = _angles(made, len(found), soft)
        located = None
        if places.box is not None:
            located = on_walls(places, made, angles)
        elif second is not None:
            located = by_second(places, (light, second), made, angles, len(found), suns or 1)
        for path, form in zip(out, forms, strict=True):
            background = None if residual is None else _relative(residual, path)
            if located is None:
                text = form.text(made, unit=light.unit, background=background, angles=angles)
            else:
                distant, apart, points = located.distant, located.angles, located.points
                text = form.text(distant, unit=light.unit, background=background, angles=apart, points=points)
            files.write_text(path, text)
        if residual is not None and rest is not None:
            files.write(residual, as_radiance_map(rest))
            if residual.suffix.lower() == ".hdr":
                note(output, f"{residual}: an .hdr file rounds its pixels to a 256th; totals are told from before that")
        if picture is not None:
            _draw(picture, light, made, f"{light_map.name}: {len(made.directions)} lights, {method}")
        given = made if located is None else located.seen(places)
        mean, worst = irradiance_error(light, given, rest)
        facts: dict[str, object] = {
            "written": [str(path) for path in written],
            "lights": len(made.directions),
            "method": method,
            "unit": light.unit,
            "total of the map": _rounded(light.total()),
            "total of the lights": _rounded(given.total()),
        }
        if rest is not None:
            facts["total of the residual"] = _rounded(rest.total())
        facts["irradiance error, of the mean"] = {"mean": float(f"{mean:.3g}"), "largest": float(f"{worst:.3g}")}
        if located is not None:
            facts |= located.facts
        if found:
            facts["suns"] = [_sun_facts(each) for each in found]
        for each in found:
            if each.flat and not each.clipped:
                note(output, f"{light_map}: the sun is of one value all over; if it is photographed it clipped there")
        print_facts(output, facts)
        doubts = _clipped(light_map, photographed, found)
        if places.second is not None and second is not None and located is not None:
            doubts += _clipped(places.second, second, located.suns)
        if doubts and not accept:
            raise DoubtfulResult("; ".join(doubts))
        for doubt in doubts:
            note(output, doubt)


def _forms(out: list[Path], named: str | None, residual: Path | None) -> list[Format]:
    """What kind of file each output is; refuses those no program reads."""
    from relume.export.light_formats import FORMATS

    suffixes = {form.suffix: form for form in FORMATS.values()}
    if named is not None and len(out) > 1:
        raise ValueError(f"--format {named} is for a single -o; the suffixes of {len(out)} tell what each is")
    for path in out:
        require_suffix(path, *(suffixes if named is None else (path.suffix.lower(),)))
    if len(set(out)) < len(out):
        raise ValueError("-o names one file twice")
    forms = [FORMATS[named] if named else suffixes[path.suffix.lower()] for path in out]
    for form in forms:
        if residual is not None and form.background_suffix == ".hdr" and residual.suffix.lower() != ".hdr":
            raise ValueError(f"--residual {residual}: {form.name} reads .hdr backgrounds only; name it so")
    return forms


def _check(
    count: int | None, suns: int | None, residual: Path | None, contrast: float | None, picture: Path | None
) -> None:
    """Refuse what cannot be, before any work."""
    if count is not None and not 1 <= count <= MOST:
        raise ValueError(f"--count is {count}; give 1 to {MOST}, like {COUNT}")
    if suns is not None and suns < 1:
        raise ValueError(f"--sun is {suns}; give 1 or more, or leave it out")
    if suns is not None and count is not None and count < suns + (residual is None):
        raise ValueError(
            f"--count {count} with --sun {suns} leaves no light for the rest; give more, or keep it with --residual"
        )
    if contrast is not None and residual is None:
        raise ValueError("--contrast is for the residual; give --residual FILE.exr too")
    if contrast is not None and not contrast >= 0:
        raise ValueError(f"--contrast is {contrast}; give 0 or more, like 4")
    if residual is not None:
        require_suffix(residual, ".exr", ".hdr", option="--residual")
    if picture is not None:
        require_suffix(picture, ".png", option="--picture")


def _divided(
    light: EnvironmentMap, count: int | None, suns: int | None, keep: bool, contrast: float | None, method: Regions
) -> tuple[tuple[Sun, ...], EnvironmentMap | None, Constellation]:
    """The suns, the residual where one is kept, and all the lights, the suns first."""
    from relume.light.constellations.constellation import constellation, together
    from relume.light.constellations.residual import key_lights
    from relume.light.suns.extraction import extract_sun

    if suns is None:
        if not keep:
            return (), None, constellation(light, count or COUNT, method)
        key = key_lights(light, count or COUNT, 4.0 if contrast is None else contrast, method)
        return (), key.residual, key.lights
    taken = extract_sun(light, suns)
    others = (count or COUNT) - len(taken.suns)
    if keep and (others < 1 or (count is None and contrast is None)):
        return taken.suns, taken.rest, taken.lights()
    if not keep:
        return taken.suns, None, together(taken.lights(), constellation(taken.rest, others, method))
    key = key_lights(taken.rest, others, 4.0 if contrast is None else contrast, method)
    return taken.suns, key.residual, together(taken.lights(), key.lights)


def _method(word: Method) -> Regions:
    from relume.light.constellations.k_means import KMeans
    from relume.light.constellations.median_cut import MedianCut
    from relume.light.constellations.variance_minimisation import VarianceMinimisation

    return {"median-cut": MedianCut(), "variance": VarianceMinimisation(), "k-means": KMeans()}[word]


def _angles(made: Constellation, suns: int, soft: bool) -> np.ndarray | None:
    """Apparent diameters in radians: the suns', and with `soft` those of all; None where all light is parallel."""
    import numpy as np

    if made.angular_radii is None or not (suns or soft):
        return None
    angles = np.minimum(2 * made.angular_radii, np.pi)
    return angles if soft else np.where(np.arange(len(angles)) < suns, angles, 0)


def _clipped(path: Path, light: EnvironmentMap, suns: Sequence[Sun]) -> list[str]:
    """What a map's clipped pixels make doubtful: a line, or none."""
    import numpy as np

    from relume.image.radiance import SATURATED

    number = 0 if light.clipped is None else int(np.count_nonzero(light.clipped == SATURATED))
    if not number:
        return []
    where = (
        "the sun is clipped, its light a lower bound" if any(sun.clipped for sun in suns) else "lights there are weaker"
    )
    return [
        f"{path}: {number} pixels are clipped, so {where}; photograph them in shorter exposures, or recover a sun with "
        "`relume sun`"
    ]


def _relative(background: Path, file: Path) -> str:
    """The background's path as the file beside it may name it."""
    try:
        return Path(os.path.relpath(background, file.parent)).as_posix()
    except ValueError:
        raise ValueError(f"--residual {background}: on another drive than {file}; write them to the same") from None


def _draw(path: Path, light: EnvironmentMap, made: Constellation, title: str) -> None:
    from relume.image import files
    from relume.report.constellation_plot import lights_plot

    with files.replacing(path) as temporary:
        temporary.write_bytes(lights_plot(light, made, title))


def _sun_facts(sun: Sun) -> dict[str, object]:
    import numpy as np

    x, y, z = sun.direction
    return {
        "direction": _rounded(sun.direction),
        "height": float(f"{np.degrees(np.arcsin(np.clip(y, -1, 1))):.4g}"),
        "to the right": float(f"{np.degrees(np.arctan2(x, -z)):.4g}"),
        "irradiance": _rounded(sun.irradiance),
        "diameter": float(f"{np.degrees(2 * sun.angular_radius):.3g}"),
        "share": float(f"{sun.share:.3g}"),
        "clipped": sun.clipped,
    }


def _rounded(values: np.ndarray) -> list[float]:
    return [float(f"{value:.6g}") for value in values]
