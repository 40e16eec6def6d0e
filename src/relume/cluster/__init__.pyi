from .connection import Cluster as Cluster
from .connection import connect as connect
from .folder_lock import held as held
from .tasks import run_tasks as run_tasks
