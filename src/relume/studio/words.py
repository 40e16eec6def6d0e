"""What relume says, in the words of the page: a line that names an option of a command names what the page offers.

Commands, Python and the page share their messages. Who looks at the page has no command line; it has steps and a file.
"""

from __future__ import annotations

import re

OFFERED = (
    # The rim of a ball.
    (r"(; |^)round things that may be picked are .*?; --picture draws them",
     r"\1lay the rim on it by its handles, under Light"),
    (r"look at it with --picture and choose it with --pick",
     "look at it under Light, and drag the rim to the right one"),
    (r"; or write the ball's rim into (light\.balls\.\d+|camera\.ball): .*",
     "; lay the rim on it by its handles, under Light"),
    (r"pick (its|the) rim( in the first)? with --pick [^\s;]*[^\s;,]", r"lay \1 rim\2 on it under Light"),
    (r"choose it with --pick", "lay the rim on it under Light"),
    (r"; or the rim was missed: `relume probe --picture` draws it, and light\.balls\.pick or rim gives it",
     "; or the rim was missed: lay it on the ball under Light"),
    (r"`relume probe --picture` draws it; choose it with light\.balls\.pick", "look at it and lay it anew under Light"),
    (r"`relume probe --picture` draws it", "look at it under Light"),
    # Exposures.
    (r"take those with --times-from-names, or", "give those as “times” in the shot file, or"),
    (r"if they are, give --times-from-names", "if they are, give them as “times” in the shot file"),
    (r"; --times-from-names reads .*", ""),
    (r"leave them out with --ignore .*", "leave them out of the photographs"),
    (r" by relume merge --spot where they are merged", " where they are merged"),
    # Measures.
    (r"give the ball's radius and distance by tape measure \(.*?\)",
     "give the ball's radius (under Light) and the camera's place by tape measure"),
    (r"give --radius and --distance, metres", "give the ball's radius (under Light) and the camera's place, metres"),
    (r"was the camera's height given \(--camera X,Y,Z with Y up\)\? .*", "was the camera's height given under Light?"),
    (r" \(--radius\)", " (under Light)"),
    (r", --focal-length$", ""),
    (r" if you know it \(--luminance\)", ", which a meter shows: click a place under Radiance and type it"),
    # A map and what was painted on its slice.
    (r"give --original, the slice that was written, or --slice \S+",
     "slice the map anew under Light and paint on that"),
    (r"; give --slice \S+ and remove it", "; slice the map anew under Light and paint on that"),
    (r"give that map, or the slice before painting as --original", "slice the map anew under Light and paint on that"),
    (r", or give --tolerance 8 or the --original saved by the same program", ""),
    (r", or raise --tolerance", ""),
    (r"; --scale keeps lights, a darker --slice shows them",
     "; “Lights beyond white stay lights” keeps them, a darker slice shows them"),
    (r": convert --(for|mirror) \S+ again", ""),
    (r"; --max 0 sets them to 0", "; set them to 0 before"),
    (r"; give it with --from", ""),
    # Places.
    (r"; run `relume model[^`]*`( first| again)?", "; solve it"),
    # Files.
    (r"(?<![\w-])--(depth|vectors) ", ""),
    (r"make them with --frames .*", "render the composite again, which makes them"),
    (r"give --profile for its camera's curve, or a bracket",
     "give a bracket, or name its camera's profile in the shot file"),
    (r", or salvage what is there \(--salvage\)", ""),
    (r", or raise that \(--largest MEGAPIXELS\) if that is so", ", or make it smaller"),
    (r"; --clamp sets the negative ones to 0", ""),
    (r"; give it, --float-size \S+", "; write it as .exr"),
    (r"; to read it again give it, --float-size \S+", ""),
    (r"; give --float-order .*", "; write it as .exr"),
)  # fmt: skip
"""Each way in which a line names options, and what stands there in the page."""
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")


def in_the_page(line: str) -> str:
    """The line, one line, with what the page offers in place of options of the command line."""
    line = " ".join(line.split())
    for pattern, offered in OFFERED:
        line = re.sub(pattern, offered, line)
    # What is only added in brackets is left out.
    line = re.sub(r" \((?:[^()]* )?--[a-z][^()]*\)", "", line)
    return OPTION.sub(lambda found: f"“{found[0][2:].replace('-', ' ')}” in the shot file", line)
