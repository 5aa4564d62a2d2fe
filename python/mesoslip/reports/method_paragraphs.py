"""The method behind an output as a paragraph of a paper, with citations in Pandoc's Markdown."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from mesoslip.array_types import DataTree
from mesoslip.configuration.config import Config
from mesoslip.configuration.keys import key_kind
from mesoslip.errors import ConfigError
from mesoslip.output.arrays import Tree
from mesoslip.output.kinds import kind_of
from mesoslip.quantities import column
from mesoslip.reports.model_sentences import (
    INITIAL,
    MODEL,
    contact_sentences,
    engine,
    model,
    quantity,
    slider_sentence,
)

if TYPE_CHECKING:
    from mesoslip.inference.posterior import Row

# Share of the duration before whose end a run ended early.
EARLY = 1e-3
ENERGY = "The balance of energy closes to {residual:.0e} of the work of the drive."


def run_method(tree: DataTree, config: Config) -> Iterator[str]:
    yield from engine(config)
    yield from model(config, _run_length(config))
    yield from _early_end(tree, config)
    yield from _accuracy(tree, config)


def curve_method(tree: DataTree, config: Config) -> Iterator[str]:
    error = ""
    if "error" in tree.attrs:
        size = f"{float(tree.attrs['error']):.0e}".replace("e-0", "e-")
        error = f", with an estimated error of {size} of the static force"
    yield (
        "The force F(X) of slow sliding was computed for infinitely many contacts of the "
        f"{MODEL} with mesoslip [@mesoslip]: the master equation [@braun2010] is solved as a "
        f"renewal equation{error}."
    )
    yield from contact_sentences(config, is_slow=True)
    yield INITIAL[config.contacts.initial]


# Ends of the sentence on the iteration to each settled motion.
SETTLED = {
    "periodic": "until period and peaks did not change any more",
    "irregular": "without reaching a period: numbers of the motion are means over passages",
    "smooth": "until the oscillation had decayed",
}


def cycle_method(tree: DataTree, config: Config) -> Iterator[str]:
    yield from engine(config)
    is_continued = tree.attrs.get("continued") == "true"
    start = ", from the state of an earlier cycle" if is_continued else ""
    yield (
        "It was iterated from one passage of the spring force through a section to the next"
        f"{start}, {SETTLED[str(tree.attrs['settled_motion'])]}."
    )
    yield from model(config, has_start=not is_continued)


def branches_method(tree: DataTree, config: Config) -> Iterator[str]:
    yield from engine(config)
    yield (
        "At each value it was iterated from one passage of the spring force through a section "
        "to the next, from the state of the value before, up and down over "
        f"{tree.attrs['continued_key']}."
    )
    yield from model(config)


def lyapunov_method(tree: DataTree, config: Config) -> Iterator[str]:
    yield from engine(config)
    yield (
        f"The largest Lyapunov exponent is the rate at which {tree.sizes['twin']} twins depart "
        "from the run: they start a small distance away, with the same random numbers."
    )
    yield from model(config, _run_length(config))


def steady_method(tree: DataTree, config: Config) -> Iterator[str]:
    yield (
        f"The force of steady sliding of the {MODEL}, and its linear stability, were computed "
        "with mesoslip [@mesoslip] for infinitely many contacts, from the survival of contacts "
        "over their lives and its change under a small oscillation of the slider."
    )
    yield from contact_sentences(config)
    yield slider_sentence(config.slider)
    if "velocity" in tree.coords:
        velocities = tree.to_dataset()["velocity"].values
        ends = (quantity(float(one), "m/s") for one in velocities[[0, -1]])
        yield f"Velocities are from {' to '.join(ends)}."


def onset_method(_: DataTree, config: Config) -> Iterator[str]:
    drag = ""
    if config.contacts.drag_rate:
        drag = f" and is dragged at the rate η = {quantity(config.contacts.drag_rate, '1/s')}"
    yield (
        f"The onset of slip of the {MODEL} was computed with mesoslip [@mesoslip], from the "
        "force curve of the master equation [@braun2010], for contacts that break one after "
        f"another and for a film that melts at once{drag}."
    )
    yield from model(config, is_slow=True)


def sweep_method(tree: DataTree, config: Config) -> Iterator[str]:
    # Others are realizations, directions and numbers of samples.
    keys = ", ".join(str(name) for name in tree.coords if "." in str(name))
    count = tree.sizes.get("realization", 1)
    each = f", with {count} realizations each" if count > 1 else ""
    yield from engine(config)
    yield from model(config, _run_length(config))
    each = (", up and down" if "direction" in tree.coords else "") + each
    yield f"Varied were {keys}{each}; values above of these keys are those of the base."


def fit_method(tree: DataTree, config: Config) -> Iterator[str]:
    """Sentences on a fit, with the medians of its free keys."""
    from mesoslip.inference import posterior

    rows = posterior.table(tree)
    estimates = "; ".join(_estimate(one) for one in rows)
    # With the digits that the intervals have.
    medians = {
        one.key: float(f"{one.percentiles[2]:.{one.digits}g}")
        for one in rows
        if key_kind(one.key) is not None
    }
    whole = {key for key in medians if (kind := key_kind(key)) is not None and kind.is_whole}
    values = {key: round(one) if key in whole else one for key, one in medians.items()}
    note = "Values of free keys are medians of the posterior."
    try:
        config = config.replace(values)
    except ConfigError:
        note = f"Values above of {', '.join(values)} are not those of the fit."
    is_predicted = tree.attrs.get("predicted") == "true"
    count = 1 if is_predicted else len(str(tree.attrs.get("traces", "")).split("\n"))
    what, those, its = (
        ("a measured force", "The trace", "of it, with its")
        if count == 1
        else (f"{count} measured forces", "The traces", "of them, with their")
    )
    yield (
        f"Parameters of the {MODEL} were estimated with mesoslip [@mesoslip] from {what} (median, "
        f"interval of 90 %): {estimates}. {those} and {tree.attrs['simulation_count']} "
        f"simulations {its} sampling and noise, are reduced to the same summaries, and parameters "
        "are drawn from a synthetic likelihood of these [@wood2010] by an affine-invariant "
        "ensemble sampler [@foreman2013]."
    )
    if is_predicted:
        yield f"The trace {tree.attrs['traces']}, not in the fit, is predicted by these draws."
    yield from model(config)
    yield note


# Sentences on the method of each kind of output.
METHODS: dict[str, Callable[[DataTree, Config], Iterator[str]]] = {
    "run": run_method,
    "sweep": sweep_method,
    "cycle": cycle_method,
    "branches": branches_method,
    "curve": curve_method,
    "steady": steady_method,
    "onset": onset_method,
    "lyapunov": lyapunov_method,
    "rates": lambda tree, _: rates_method(tree),
    "fit": fit_method,
}


def computed_method(tree: DataTree, config: Config) -> str:
    """The method of an output that was computed."""
    return " ".join(METHODS[kind_of(tree)](tree, config))


def _estimate(row: Row) -> str:
    """A free key with its median and interval of 90 %."""
    shown = column(row.percentiles, row.unit, row.digits)
    low, _, median, _, high = (shown.text(one) for one in row.percentiles)
    return f"{row.key} {median} {shown.scale.name} ({low} to {high})".replace("  ", " ")


def rates_method(tree: DataTree) -> Iterator[str]:
    """A sentence on a posterior of rates and states."""
    laws = " and ".join(str(tree.attrs["laws"]).split("\n"))
    yield (
        "Rate-and-state parameters [@dieterich1979; @ruina1983] were estimated with mesoslip "
        f"[@mesoslip] from the record of the force: the motion of a slider without inertia by the "
        f"{laws} law is compared with the record, with normal noise, white and correlated, and "
        "parameters and noise are drawn by an affine-invariant ensemble sampler [@foreman2013] "
        "from independent priors, uniform or uniform in the logarithm."
    )


def measured_method(tree: DataTree) -> str:
    """The method of a measured trace, or of a posterior of its rates and states."""
    if kind_of(tree) == "rates":
        return " ".join(rates_method(tree))
    source = tree.attrs.get("measured_file", "a file")
    return (
        f"The measured trace ({source}) was analysed with mesoslip [@mesoslip]: slips are falls of "
        "the force that stand out of the noise and of ringing, by a rule without a model."
    )


def _run_length(config: Config) -> str:
    """The end of the sentence on the drive of a run."""
    finite = math.isfinite(config.duration)
    return f" for {quantity(config.duration, 's')}" if finite else " until a condition is met"


def _early_end(tree: Tree, config: Config) -> Iterator[str]:
    """A sentence on a run that ended before its drive."""
    data = tree.to_dataset()
    if "time" not in data or not len(data["time"].values):
        return
    end, ending = float(data["time"].values[-1]), str(tree.attrs.get("ending", ""))
    if tree.attrs.get("complete") == "false":
        ending = "it was interrupted"
    if end < (1 - EARLY) * config.duration and ending:
        which = "It" if config.run.realizations == 1 else "The longest realization"
        yield f"{which} ended at {quantity(end, 's')}: {ending}."


def _accuracy(tree: DataTree, config: Config) -> Iterator[str]:
    """Sentences on the integration of the slider, and on its error."""
    method = config.slider.solver_name(config)
    if method in {"adams", "bdf"}:
        yield "The slider is integrated by CVODE of SUNDIALS [@hindmarsh2005]."
    residual = abs(float(tree.attrs.get("energy_residual", math.nan)))
    if residual > 0:
        yield ENERGY.format(residual=residual)
