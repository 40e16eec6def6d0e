from .irradiance_cache.irradiance_cache import IrradianceCache as IrradianceCache
from .radiosity.form_factors import FormFactors as FormFactors
from .radiosity.form_factors import form_factors as form_factors
from .radiosity.radiosity import Radiosity as Radiosity
from .renderer import ConstantRenderer as ConstantRenderer
