"""`relume info`: what a file holds, or what this machine renders with."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import ReadingOptions, require_suffix
from relume.cli.console import OutputOptions, print_facts, refuse, warnings_as_notes

_FORMATS = {"EXR": "OpenEXR", "HDR": "Radiance", "RAW": "camera raw", "KTX2": "KTX 2.0"}
_LARGEST_HALF = 65504
_CAPTURE = ("exposure_time", "f_number", "iso", "camera_make", "camera", "lens", "focal_length", "taken")
_NO_EXPOSURE = {"exposure": "the file stores none"}  # unless it does; without one no photograph can be merged
_WIDEST = 30  # of its name: a column as wide as the longest is left for them all
_LONGEST = 100  # characters of an attribute that fit beside its name


def lines_of(facts: Mapping[str, Any], *, whole: bool = False) -> dict[str, str]:
    """The facts of `rl.report.describe` as label → text, in the order to print.

    facts : with "direction" in the places that have one
    whole : print attributes to their end, however long
    """
    kind = facts["kind"]
    if kind in ("mesh", "maps"):
        return _mesh(facts) if kind == "mesh" else rl.report.maps_summary(facts)
    name = _FORMATS.get(facts["format"], facts["format"])
    lines = {"format": f"{name}: {facts['subtype']}" if facts["subtype"] else name, "size": _size(facts)}
    if kind == "photograph":
        lines |= {"holds": "an encoded photograph", **_NO_EXPOSURE} | _captured(_of_photograph(facts)) | _codes(facts)
        if facts["light"] is not None:
            lines |= {f"light: {name}": text for name, text in _light(facts["light"]).items()}
    elif kind == "camera raw":
        lines |= {"holds": "a sensor's own values, one a photosite", **_NO_EXPOSURE}
        lines |= _captured(_of_photograph(facts)) | _sensor(facts)
    else:
        if kind == "radiance map":
            lines |= {"holds": _meaning(facts)} | _captured(facts["attributes"])
        lines |= _light(facts) | _faults(facts)
    others = {key: text for key, text in facts["attributes"].items() if key not in (*_CAPTURE, "primaries")}
    if others:
        lines["attributes"] = str(len(others))
        lines |= {f"  {_printable(key)[:_WIDEST]}": _shortened(text, whole) for key, text in sorted(others.items())}
    return {**lines, **_parts(facts)}


def _mesh(facts: Mapping[str, Any]) -> dict[str, str]:
    across, up, along = (number(value) for value in facts["extent"])
    (x, foot, z), (right, _, near) = facts["low"], facts["high"]
    middle = ", ".join(number(round(value, 5) + 0.0) for value in ((x + right) / 2, (z + near) / 2))
    materials = [_printable(name) for name in facts["materials"]]
    parts = f" in {facts['meshes']} parts" if facts["meshes"] > 1 else ""
    return {
        "format": facts["format"], "holds": "a mesh: an object of `insert` or `render`",
        "size": f"{across} × {up} × {along} m, if its unit is the metre",
        "stands": f"foot at {number(round(foot, 5) + 0.0)} m over x, z {middle}",
        "triangles": f"{facts['triangles']:,}{parts}, {facts['vertices']:,} vertices",
        "materials": _shortened(", ".join(materials), whole=False),
    }  # fmt: skip


def number(value: float) -> str:
    """A number of three digits, or four above 1000, as one writes it: 0.0123, 4,096, 1.23e8."""
    if value == 0 or not 1e-4 <= abs(value) < 1e6:
        digits, _, power = f"{value:.3g}".partition("e")
        return f"{digits}e{int(power)}" if power else digits
    return f"{float(f'{value:.3g}' if abs(value) < 1000 else f'{value:.4g}'):,.10g}"


def _size(facts: Mapping[str, Any]) -> str:
    width, height = facts["size"]
    if facts["kind"] == "cube":
        sides = facts["levels"]
        smaller = f"; {len(sides)} levels, down to {sides[-1]} × {sides[-1]}" if len(sides) > 1 else ""
        return f"six faces of {width} × {height}{smaller}"
    megapixels = width * height / 1e6
    return f"{width} × {height}" + (f", {megapixels:.1f} megapixels" if megapixels >= 0.1 else "")


def _meaning(facts: Mapping[str, Any]) -> str:
    unit = "radiance in cd/m²" if facts["unit"] == "cd/m²" else "radiance, no absolute unit"
    given = facts["primaries_of_file"]
    if given is None:
        return f"{unit}, {facts['primaries']}"
    return f"{unit}, {facts['primaries']} (converted from primaries {_printable(given)})"


def _of_photograph(facts: Mapping[str, Any]) -> dict[str, str]:
    """The capture facts of a photograph under the names that attributes of maps have."""
    exposure, settings = facts["exposure"] or {}, facts["settings"]
    found = {
        "exposure_time": exposure.get("seconds"),
        "f_number": exposure.get("f_number"),
        "iso": exposure.get("iso"),
        "camera": facts["camera"],
        **{name: settings[name] for name in ("lens", "focal_length", "bias", "automatic_white")},
    }
    if settings["taken"] is not None:
        day, _, time = settings["taken"].partition("T")
        found["taken"] = f"{day} {time.rstrip('0') if '.' in time else time}"
    return {name: str(value) for name, value in found.items() if value not in (None, "")}


def _captured(found: Mapping[str, str]) -> dict[str, str]:
    """Exposure, camera and time of a file, by the names that attributes have in `rl.files`."""
    exposure = []
    if "exposure_time" in found:
        seconds = _float(found["exposure_time"]) or 0
        exposure.append(rl.capture.seconds_in_words(seconds) if seconds > 0 else f"{found['exposure_time']} s")
    if "f_number" in found:
        exposure.append(f"f/{_plain(found['f_number'])}")
    if "iso" in found:
        exposure.append(f"ISO {_plain(found['iso'])}")
    bias = _float(found.get("bias"))
    if bias and exposure:
        exposure.append(f"compensated by {bias:+.3g} stops")
    make, model = found.get("camera_make", ""), found.get("camera", "")
    camera = [model if model.lower().startswith(make.lower()) else f"{make} {model}".strip()]
    lens = found.get("lens", "")
    camera += [lens] * bool(lens)
    focal_length = _plain(found.get("focal_length", ""))
    # A fixed lens has its focal length in its name.
    camera += [f"at {focal_length} mm"] * bool(focal_length and f"{focal_length}mm" not in lens.replace(" ", ""))
    lines = {
        "exposure": ", ".join(exposure),
        "white balance": {"True": "automatic", "False": "set by hand"}.get(found.get("automatic_white", ""), ""),
        "camera": ", ".join(filter(None, camera)),
        "taken": re.sub(r"^(\d{4}):(\d\d):", r"\1-\2-", found.get("taken", "")),
    }
    return {label: _printable(text) for label, text in lines.items() if text}


def _light(facts: Mapping[str, Any]) -> dict[str, str]:
    light, span = facts["luminance"], facts["dynamic_range"]
    if not light["lit"]:
        return {"luminance": "no pixel is brighter than 0"}
    unit = " cd/m²" if facts["unit"] == "cd/m²" else ""
    width, height = facts["size"]
    pixels = width * height * (6 if facts["kind"] == "cube" else 1)
    dark = pixels - light["lit"]
    where = " of the lit pixels" if dark else ""
    even = light["minimum"] == light["maximum"]
    lines = {
        "dynamic range": f"none: all{' lit' if dark else ''} pixels are alike"
        if even
        else f"{_range(span['robust_stops'], span['robust_ratio'])} from percentile 0.1 to 99.9{where}; "
        f"{_range(span['stops'], span['ratio'])} in all",
        "luminance": f"{number(light['minimum'])} to {number(light['maximum'])}{unit}{where}, mean "
        f"{number(light['mean'])}" + (f" of all; {_share(dark / pixels)} are not above 0" if dark else ""),
    }
    if not even:
        lines["percentiles"] = _percentiles(light["percentiles"], number)
    for label, place in (("brightest", facts.get("brightest")), ("lone pixel", facts.get("lone"))):
        if place is not None:
            lines[label] = _place(place, unit)
    if "lone pixel" in lines:
        lines["lone pixel"] += "; four stops above all around it: a firefly, or a sun smaller than a pixel"
    return lines


def _place(place: Mapping[str, Any], unit: str) -> str:
    text = f"{number(place['luminance'])}{unit} at x {place['x']}, y {place['y']}"
    if place.get("direction"):
        text += f": {_direction(place['direction'])}"
    colour = " ".join(f"{name} {number(value)}" for name, value in zip("RGB", place["radiance"], strict=True))
    return f"{text}; {colour}; mean of 3 × 3 pixels {number(place['around'])}"


def _direction(direction: Mapping[str, Any]) -> str:
    right, up = round(direction["azimuth"]), round(direction["elevation"])
    across = "ahead" if right == 0 else f"{abs(right)}° to the {'right' if right > 0 else 'left'}"
    along = "level" if up == 0 else f"{abs(up)}° {'up' if up > 0 else 'down'}"
    assumed = " if lat-long" if direction["assumed"] else ""
    return f"{across}, {along}{assumed}"


def _faults(facts: Mapping[str, Any]) -> dict[str, str]:
    lines = {}
    if facts["at_maximum"] > 1:
        most = facts["maximum"]
        full = most == _LARGEST_HALF and facts["dtype"] == "float16"
        value = f"{_LARGEST_HALF:,}, the most that half floats hold" if full else number(most)
        lines["at maximum"] = f"{facts['at_maximum']:,} pixels at {value}"
    if facts.get("clipped") is not None:
        counts = facts["clipped"]
        words = {"saturated": "saturated in every photograph", "black": "black in every one", "outside": "outside all"}
        found = [f"{counts[name]:,} {text}" for name, text in words.items() if counts[name]]
        lines["marked pixels"] = ", ".join(found) or "none: every pixel was measured"
    names = {"nan": "not a number", "infinite": "infinite", "negative": "below 0"}
    odd = [f"{facts[name]:,} {text}" for name, text in names.items() if facts[name]]
    if odd:
        lowest = f", the lowest {number(facts['minimum'])}" if facts["negative"] else ""
        lines["odd values"] = ", ".join(odd) + lowest
    return lines


def _codes(facts: Mapping[str, Any]) -> dict[str, str]:
    top = 255 if facts["dtype"] == "uint8" else 65535
    lines = {}
    if facts["minimum"] is not None:
        lines["codes"] = f"{facts['minimum']} to {facts['maximum']}, mean {facts['mean']:.1f}"
        lines["percentiles"] = _percentiles(facts["percentiles"], str)
        lines["at 0"] = _shares(facts["at_black"])
        lines[f"at {top}"] = _shares(facts["at_white"])
    if facts["transparent"]:
        lines["transparent"] = f"{facts['transparent']:,} pixels, which count nowhere"
    if facts["colour_space"] != "sRGB":
        lines["colour space"] = facts["colour_space"]
    if facts["gain_map"] is not None:
        lines["gain map"] = facts["gain_map"].removeprefix("gain map of ")
    return lines


def _sensor(facts: Mapping[str, Any]) -> dict[str, str]:
    black = sorted(set(facts["black"]))
    return {
        "black": ", ".join(f"{level:g}" for level in black),
        "white": f"{facts['white']:g}",
        "balance": f"daylight R, G, B × {_gains(facts['daylight'])}"
        + ("" if facts["as_shot"] is None else f"; as shot × {_gains(facts['as_shot'])}"),
        "codes": f"{facts['minimum']} to {facts['maximum']}, mean {facts['mean']:.1f}",
        "percentiles": _percentiles(facts["percentiles"], str),
        "at white": _shares(facts["at_white"]),
    }


def _parts(facts: Mapping[str, Any]) -> dict[str, str]:
    """Channels of an EXR's parts; their size too where it is not that of the picture."""
    parts = facts["parts"]
    found = []
    for part in parts:
        text = f"{', '.join(map(_printable, part['channels']))} ({part['dtype']})"
        found.append(text if part["size"] == facts["size"] else f"{text}, {' × '.join(map(str, part['size']))} pixels")
    if len(parts) == 1:
        return {"channels": found[0]}
    names = [f"{_printable(part['name'])}: " if part["name"] else "" for part in parts]
    return {f"part {count}": name + text for count, (name, text) in enumerate(zip(names, found, strict=True), 1)}


def _percentiles(values: Mapping[str, Any], shown: Any) -> str:
    return " · ".join(f"{percent} % {shown(value)}" for percent, value in values.items())


def _shares(shares: list[float]) -> str:
    if not any(shares):
        return "none"
    return " · ".join(f"{name} {_share(share)}" for name, share in zip("RGB", shares, strict=True))


def _share(share: float) -> str:
    """A share in percent that is 0 only where nothing is, and 100 only where all is."""
    if 0 < share < 0.0001:
        return "< 0.01 %"
    return "> 99.99 %" if 0.9999 < share < 1 else f"{100 * share:.3g} %" if share < 0.99 else f"{100 * share:.2f} %"


def _gains(gains: list[float]) -> str:
    return ", ".join(f"{gain:.3g}" for gain in gains)


def _range(stops: float, ratio: float) -> str:
    text = number(ratio) if ratio >= 1e6 else f"{float(f'{ratio:.3g}'):,.0f}" if ratio >= 100 else f"{ratio:.3g}"
    return f"{stops:.1f} stops ({text} : 1)"


def _plain(text: str) -> str:
    value = _float(text)
    return text if value is None else f"{value:.6g}"


def _float(text: str | None) -> float | None:
    """A number, or a fraction as EXIF has them; None for anything else that a file may hold."""
    above, slash, below = (text or "").partition("/")
    try:
        value = float(above) / float(below) if slash else float(above)
    except (ValueError, ZeroDivisionError):
        return None
    return value if math.isfinite(value) else None


def _printable(text: str) -> str:
    """A file's own words on one line; what would move a terminal's cursor is a blank."""
    return " ".join("".join(letter if letter.isprintable() else " " for letter in text).split())


def _shortened(text: str, whole: bool) -> str:
    line = _printable(text)
    return line if whole or len(line) <= _LONGEST else f"{line[:_LONGEST]} … ({len(line)} characters; -v shows all)"


def info(
    paths: Annotated[
        list[Path] | None,
        Parameter(help="Pictures, radiance maps, environment maps, camera raws, cubes, meshes.", negative=""),
    ] = None,
    /,
    *,
    system: Annotated[
        bool, Parameter(negative="", help="Show what this machine renders with, and what is missing.")
    ] = False,
    draw: Annotated[
        Path | None, Parameter(help="Draw an environment map at three exposures with its axes, as this .png.")
    ] = None,
    from_: Annotated[
        str | None, Parameter(name="--from", help="Mapping of the map to draw, where the file does not store it.")
    ] = None,
    brackets: Annotated[
        bool, Parameter(negative="", help="Say which exposures cover the place that a photograph shows.")
    ] = False,
    brightest: Annotated[
        float | None,
        Parameter(help="For --brackets: cd/m² of the brightest lamp; a frosted bulb has 1e5, the sun 1.6e9."),
    ] = None,
    profile: Annotated[
        Path | None, Parameter(help="For --brackets: the camera's profile, .json, for its working range.")
    ] = None,
    options: ReadingOptions = ReadingOptions(),
    output: OutputOptions = OutputOptions(),
) -> None:
    """Show what picture files hold: size, exposure, unit, range, faults; or what this machine renders with.

    Where a file cannot be read the others are shown, and the exit code is 2. With --json each file is one line.
    """
    with warnings_as_notes(output):
        # What is asked for.
        if system:
            print_facts(output, rl.report.describe_system(), title="relume on this machine")
        elif not paths:
            raise ValueError("name a file, or ask about this machine with --system")
        reading = options.reading()
        if draw is not None:
            _draw(paths or [], draw, from_, reading)
        elif from_ is not None:
            raise ValueError("--from is for --draw; give that too")
        if not brackets and (brightest is not None or profile is not None):
            raise ValueError(f"--{'profile' if brightest is None else 'brightest'} is for --brackets; give that too")
        response = None if profile is None else rl.capture.read_profile(profile).response
        # Each file by itself; one that cannot be read does not keep the others.
        unreadable: list[rl.RelumeError] = []
        for path in paths or ():
            try:
                facts = rl.report.describe(path, reading)
                if brackets:
                    shown = rl.read_photograph(path, reading)
                    advice = rl.capture.advise_brackets(shown, response=response, brightest=brightest)
            except rl.RelumeError as error:
                unreadable.append(error.with_traceback(None))  # which would keep what is open, and itself, alive
                continue
            lines: dict[str, Any] = facts if output.json else lines_of(facts, whole=output.verbose)
            if brackets:
                lines |= {"brackets": asdict(advice)} if output.json else rl.report.advice_summary(advice)
            print_facts(output, lines, title=str(path))
        # What could not be read.
        if unreadable:
            for error in unreadable[:-1]:
                refuse(str(error), 2)
            raise unreadable[-1]


def _draw(paths: list[Path], out: Path, from_: str | None, reading: rl.files.ReadOptions) -> None:
    if len(paths) != 1:
        raise ValueError(f"--draw shows one map; {len(paths)} files are named")
    require_suffix(out, ".png", option="--draw")
    light = rl.read_environment(paths[0], None if from_ is None else rl.mappings.mapping_named(from_), options=reading)
    rl.report.draw_environment(light, out, title=paths[0].name)
