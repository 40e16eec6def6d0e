"""Many lights, one at a time → any light: reflectance fields of real things, relit, seen from new places."""
