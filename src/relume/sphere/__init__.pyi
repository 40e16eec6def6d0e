from . import mappings as mappings
