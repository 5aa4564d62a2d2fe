from .analysis.avalanches import avalanche_summary, avalanches
from .analysis.catalogue_tables import write_table
from .analysis.events.summary import events
from .analysis.export import export
from .analysis.fronts import fronts
from .analysis.lyapunov import lyapunov
from .analysis.plateaus.catalogue import plateaus
from .analysis.regime.outputs import regime
from .analysis.response.dataset import response
from .analysis.slips import slips
from .analysis.strokes.catalogue import strokes
from .api import run
from .campaign.mean_field import mean_field
from .campaign.sweep import sweep
from .configuration.config import Config
from .configuration.threshold_law import ThresholdLaw
from .configuration.track_strength import track_strength
from .cycles.branch import branches
from .cycles.cycle import cycle
from .cycles.cycle_result import Cycle
from .errors import ConfigError, FileError, MesoslipError, RunError
from .examples import example
from .execution.executors import Dask, Processes, Threads
from .inference.fit_trace import fit
from .inference.predict import compare_fits, predict
from .inference.rate_tree import response_posterior
from .measured.trace import read_trace
from .output.inputs import open_output
from .output.realization import Realization
from .plots.plot import plot
from .reports.report import report
from .theory.contacts.plain_sliding import SteadySliding
from .theory.curve import curve
from .theory.derived import derived
from .theory.slip_onset import onset
from .theory.steady_front import SteadyFront
from .theory.track_response import TrackResponse

__all__ = [
    "Config",
    "ConfigError",
    "Cycle",
    "Dask",
    "FileError",
    "MesoslipError",
    "Processes",
    "Realization",
    "RunError",
    "SteadyFront",
    "SteadySliding",
    "Threads",
    "ThresholdLaw",
    "TrackResponse",
    "avalanche_summary",
    "avalanches",
    "branches",
    "compare_fits",
    "curve",
    "cycle",
    "derived",
    "events",
    "example",
    "export",
    "fit",
    "fronts",
    "lyapunov",
    "mean_field",
    "onset",
    "open_output",
    "plateaus",
    "plot",
    "predict",
    "read_trace",
    "regime",
    "report",
    "response",
    "response_posterior",
    "run",
    "slips",
    "strokes",
    "sweep",
    "track_strength",
    "write_table",
]
