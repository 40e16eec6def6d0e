from .photon_map.drawing import drawn_discs as drawn_discs
from .photon_map.drawing import drawn_photons as drawn_photons
from .photon_map.photon_map import PhotonMap as PhotonMap
from .photon_map.photon_map import PhotonStep as PhotonStep
from .renderer import ConstantRenderer as ConstantRenderer
