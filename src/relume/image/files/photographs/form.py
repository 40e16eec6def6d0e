"""The form of a photograph's pixels, as the header of its file has it."""

from __future__ import annotations

from dataclasses import dataclass

from relume.image.files.tiff.layout import Layout


@dataclass(frozen=True)
class Form:
    """The form of a photograph's pixels as its header has it.

    width, height, channels, bits : as stored
    kind : in words, "RGB", "YCbCr 4:2:0", …
    packing : in words, "" for the one that every file of its format has
    gain_map : whether a JPEG has a gain map, or says so
    layout : of a TIFF
    pages : of a TIFF
    """

    width: int
    height: int
    channels: int
    bits: int
    kind: str
    packing: str = ""
    gain_map: bool = False
    layout: Layout | None = None
    pages: int = 1

    @property
    def text(self) -> str:
        """In a few words: "8 bits, YCbCr 4:2:0"."""
        depth = "1 bit" if self.bits == 1 else f"{self.bits} bits"
        return ", ".join(filter(None, [depth, self.kind, self.packing]))
