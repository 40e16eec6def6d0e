from .ball_plot import rim_plot as rim_plot
from .capture_report import write_capture_report as write_capture_report
from .constellation_plot import draw_lights as draw_lights
from .merge_facts import merge_facts as merge_facts
from .merge_facts import merge_summary as merge_summary
from .merge_facts import plan_facts as plan_facts
from .merge_facts import plan_summary as plan_summary
from .reflection_sheet import draw_reflection_sheet as draw_reflection_sheet
