"""What files say beside their pixels: EXIF, GPS, ICC profiles, XMP."""
