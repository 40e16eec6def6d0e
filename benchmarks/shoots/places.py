"""The four places by name."""

from indoors import INDOOR, PRODUCT
from outdoors import NIGHT, OUTDOOR

PLACES = {
    "indoor_windows": INDOOR, "outdoor_noon": OUTDOOR, "night_street": NIGHT, "product_table": PRODUCT,
}  # fmt: skip
