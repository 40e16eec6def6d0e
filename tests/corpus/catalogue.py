"""Every corpus by name, each made when it is asked for; and the bombs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from corpus import camera_raw, dds, exr, gain_map, heif, jpeg, ktx2, png, portable, radiance, tiff
from corpus.files import READ, READ_CUBE, READ_PHOTOGRAPH, READ_RADIANCE, Bad, Corpus

CORPORA: Mapping[str, Callable[[], Corpus]] = {
    "Radiance": radiance.corpus,
    "PFM": portable.pfm,
    "raw float": portable.raw_float,
    "float TIFF": tiff.floats,
    "LogLuv TIFF": tiff.logluv,
    "TIFF": tiff.photographs,
    "EXR": exr.corpus,
    "gain map": gain_map.corpus,
    "PNG": png.corpus,
    "JPEG": jpeg.corpus,
    "KTX2": ktx2.corpus,
    "camera raw": camera_raw.corpus,
    "DDS": dds.corpus,
    "HEIF": heif.corpus,
}


def bombs() -> list[tuple[Bad, str, str]]:
    """Small files that claim gigabytes: (file, door, corpus); the first six of the sizes that once hurt others."""
    wide = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 40000 +X 40000\n"
    portable_map = b"PF\n60000 60000\n-1.0\n".ljust(84, b"\0")
    return [
        (Bad("53 bytes of Radiance", wide[:53].ljust(53, b"\n"), ".hdr"), READ, "Radiance"),
        (Bad("84 bytes of PFM", portable_map, ".pfm"), READ, "PFM"),
        (Bad("134 bytes of TIFF", tiff.bomb(), ".tif"), READ_PHOTOGRAPH, "TIFF"),
        (Bad("353 bytes of PNG", png.bomb(), ".png"), READ_PHOTOGRAPH, "PNG"),
        (Bad("464 bytes of EXR", exr.bomb(), ".exr"), READ, "EXR"),
        (Bad("735 bytes of JPEG", jpeg.bomb(), ".jpg"), READ_PHOTOGRAPH, "JPEG"),
        (Bad("a progressive JPEG", jpeg.bomb(0xC2), ".jpg"), READ_PHOTOGRAPH, "JPEG"),
        (Bad("an EXR in a vast frame", exr.framed_bomb(), ".exr"), READ, "EXR"),
        (Bad("a float TIFF", tiff.float_bomb(), ".tif"), READ, "float TIFF"),
        (Bad("a LogLuv TIFF", tiff.logluv_bomb(), ".tif"), READ, "LogLuv TIFF"),
        (Bad("a gain map", gain_map.bomb(), ".jpg"), READ_RADIANCE, "gain map"),
        (Bad("a DDS cube", dds.bomb(), ".dds"), READ_RADIANCE, "DDS"),
        (Bad("a HEIF", heif.bomb(), ".heic"), READ_PHOTOGRAPH, "HEIF"),
        (Bad("a cube", ktx2.bomb(), ".ktx2"), READ_CUBE, "KTX2"),
    ]
