"""Paper on paper, measured beside the model: the table and the picture of docs/paper-on-paper.md.

The files are the fit of two records and its prediction of a third one, as the page makes them:

    python tests/studies/paper_on_paper.py out/paper.nc out/paper-4300.nc docs/paper-on-paper.png
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import mesoslip
import numpy as np
import xarray as xr
from matplotlib import pyplot as plt

WEIGHT = 30.7e-3 * 9.81
# Spring and drive of the records, in the order of the files.
RECORDS = (("1002 N/m, 42 µm/s", 1002 * 42e-6, 5.0), ("168 N/m, 42 µm/s", 168 * 42e-6, 20.0))
RECORDS += (("1002 N/m, 4300 µm/s", 1002 * 4300e-6, 0.3),)
# Maximum distance of the median from the measured value, and maximum width of an interval, relative
# or absolute.
NEAR = {"": 0.25, "cv": 0.1, "correlation": 0.2}
WIDE = {"": 2.0, "cv": 0.4, "correlation": 0.4}


@dataclass(frozen=True)
class Quantity:
    name: str
    kind: str
    digits: str
    measured: float
    predicted: np.ndarray

    @property
    def verdict(self) -> str:
        if not np.isfinite(self.measured):
            return "not defined"
        low, middle, high = np.nanpercentile(self.predicted, [5, 50, 95])
        if self.kind == "":
            is_wide = high > WIDE[""] * low
            is_near = abs(middle - self.measured) <= NEAR[""] * abs(self.measured)
        else:
            is_wide = high - low > WIDE[self.kind]
            is_near = abs(middle - self.measured) <= NEAR[self.kind]
        if not (low <= self.measured <= high and is_near):
            return "not met"
        return "not decided" if is_wide else "met"

    def row(self) -> str:
        if not np.isfinite(self.measured):
            return f"| {self.name} | | | | {self.verdict} |"
        low, middle, high = np.nanpercentile(self.predicted, [5, 50, 95])
        shown = [format(one, self.digits) for one in (self.measured, middle, low, high)]
        return (
            f"| {self.name} | {shown[0]} | {shown[1]} | {shown[2]} to {shown[3]} | {self.verdict} |"
        )


def of_slips(slips: xr.Dataset) -> dict[str, float]:
    start, end, before, after = (
        slips[name].values for name in ("start_time", "end_time", "force_before", "force_after")
    )
    if len(start) < 4:
        return {"count": float(len(start))}
    drop = before - after
    return {
        "count": float(len(start)),
        "drop": 1e3 * drop.mean(),
        "cv": drop.std() / drop.mean(),
        "wait": np.diff(start).mean(),
        "duration": 1e3 * (end - start).mean(),
        "correlation": float(np.corrcoef(before[:-1], before[1:])[0, 1]),
    }


def quantities(tree: xr.DataTree, suffix: str, prefix: str, loading: float) -> Iterator[Quantity]:
    summaries = tree["summaries"].to_dataset()
    drawn = tree[f"predicted_slips{suffix}"].to_dataset()
    observed = of_slips(tree[f"observed_slips{suffix}"].to_dataset())
    count = tree[f"posterior_predictive{suffix}"].sizes["draw"]
    each = [of_slips(drawn.isel(slip=drawn["trace"].values == one)) for one in range(count)]

    def from_slips(key: str) -> tuple[float, np.ndarray]:
        return observed.get(key, np.nan), np.array([one.get(key, np.nan) for one in each])

    def from_summary(name: str, size: float, is_log: bool) -> tuple[float, np.ndarray]:
        one = summaries.sel(summary=prefix + name)
        values = one["observed"].values, one["drawn"].values
        first, others = (np.exp(value) if is_log else value for value in values)
        return size * float(first), size * others

    def factor(name: str) -> float:
        return float(summaries["factor"].sel(summary=prefix + name))

    yield Quantity("number of slips", "", ".0f", *from_slips("count"))
    yield Quantity("mean drop (mN)", "", ".1f", *from_slips("drop"))
    yield Quantity("coefficient of variation of drops", "cv", ".2f", *from_slips("cv"))
    yield Quantity("mean waiting time (s)", "", ".3g", *from_slips("wait"))
    yield Quantity("mean duration (ms)", "", ".1f", *from_slips("duration"))
    slope = from_summary("stick_slope", factor("stick_slope") / loading, True)
    yield Quantity("slope of the loading over K v", "cv", ".2f", *slope)
    yield Quantity("creep over the drop", "cv", ".3f", *from_summary("creep_0.95", 1.0, False))
    yield Quantity("correlation of forces", "correlation", ".2f", *from_slips("correlation"))
    mean = from_summary("mean_force", 1e3 * factor("mean_force"), False)
    yield Quantity("mean force (mN)", "", ".0f", *mean)


def draw(axes: np.ndarray, tree: xr.DataTree, suffix: str, name: str, shown: float) -> None:
    observed = tree[f"observed_data{suffix}"].to_dataset()["spring_force"]
    drawn = tree[f"posterior_predictive{suffix}"].to_dataset()["spring_force"][0]
    slips = tree[f"predicted_slips{suffix}"].to_dataset()
    counts = np.bincount(slips["trace"].values, minlength=drawn.sizes["draw"])
    typical = int(np.argsort(counts)[len(counts) // 2])
    middle = float(observed["time"][observed.sizes["time"] // 2])
    for panel, values, title in (
        (axes[0], observed, "measured"),
        (axes[1], drawn[typical], "model"),
    ):
        time = values["time"].values
        inside = (time >= middle) & (time < middle + shown)
        panel.plot(time[inside] - middle, values.values[inside] / WEIGHT, "k", linewidth=0.7)
        panel.set_title(f"{name}: {title}" if panel is axes[0] else title, loc="left", fontsize=8)
        panel.set_xlabel("time (s)", fontsize=8)
    both = [tree[f"{kind}{suffix}"].to_dataset() for kind in ("observed_slips", "predicted_slips")]
    drops = [1e3 * (one["force_before"] - one["force_after"]).values for one in both]
    waits = [np.diff(both[0]["start_time"].values)]
    owner, start = both[1]["trace"].values, both[1]["start_time"].values
    waits.append(np.diff(start)[np.diff(owner) == 0])
    for panel, values, label in (
        (axes[2], drops, "drop (mN)"),
        (axes[3], waits, "waiting time (s)"),
    ):
        high = np.percentile(np.concatenate([values[0], values[1]]), 99)
        bins = np.linspace(0, max(high, 1.05 * values[0].max()), 22)
        for one, color, kind in zip(values, ("black", "C1"), ("measured", "model"), strict=True):
            weights = np.full(len(one), 1 / len(one))
            style = "stepfilled" if kind == "model" else "step"
            panel.hist(one, bins, weights=weights, histtype=style, color=color, label=kind,
                       alpha=0.5 if kind == "model" else 1)  # fmt: skip
        panel.set_xlabel(label, fontsize=8)
        panel.set_ylabel("share of slips", fontsize=8)
    axes[0].sharey(axes[1])
    axes[0].set_ylabel("force over weight", fontsize=8)


def main(fitted: str, predicted: str, picture: str) -> None:
    trees = [mesoslip.open_output(one) for one in (fitted, predicted)]
    places = [(trees[0], "", "1."), (trees[0], "_2", "2."), (trees[1], "", "")]
    figure, axes = plt.subplots(3, 4, figsize=(11, 6.6), layout="constrained")
    for row, (place, (name, loading, shown)) in enumerate(zip(places, RECORDS, strict=True)):
        tree, suffix, prefix = place
        print(f"\n{name}: p = {tree.attrs['agreement_probability']:.3f}\n")
        print("| | measured | model | 90 % of the predictions | |\n|---|---|---|---|---|")
        for one in quantities(tree, suffix, prefix, loading):
            print(one.row())
        draw(axes[row], tree, suffix, name, shown)
    axes[0, 2].legend(fontsize=7, frameon=False)
    for panel in axes.ravel():
        panel.tick_params(labelsize=7)
        panel.spines[["top", "right"]].set_visible(False)
    figure.savefig(Path(picture), dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:4])
