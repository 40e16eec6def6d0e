from .renderer import ConstantRenderer as ConstantRenderer
