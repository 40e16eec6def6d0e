from .constellations.constellation import Constellation as Constellation
from .constellations.residual import key_lights as key_lights
from .constellations.variance_minimisation import VarianceMinimisation as VarianceMinimisation
from .reflection.reflection_map import ReflectionMap as ReflectionMap
from .reflection.reflection_map import reflection_map as reflection_map
from .suns.clipped_sun import recover_sun as recover_sun
