"""Sizes of avalanches against the theory of branching processes and of fibre bundles."""

import itertools
import json
import math

import mesoslip
import numpy as np
import pytest
from conftest import klein_tables, long
from kinds import FAST, PLACES, THERMAL
from mesoslip import Config
from mesoslip.analysis.avalanche_sizes import EXPONENTIAL_CUTOFF, fit_power_law
from mesoslip.analysis.avalanches import failures
from mesoslip.output import writing
from scipy import integrate, special, stats


def sliding(stiffness: float, avalanches: int, **changes) -> Config:
    """Stationary sliding of memoryless contacts on a spring, without inertia."""
    tables = klein_tables(
        slider={"kind": "quasistatic", "stiffness": stiffness},
        run={"avalanches": avalanches},
        contacts__count=100_000,
        contacts__coupling="equal",
        contacts__initial="steady",
        contacts__back_force_ratio=0.0,
        contacts__threshold={"law": "exponential", "relative_width": 1.0},
        **changes,
    )
    del tables["output"]
    return Config.from_dict(tables)


def bundle(count: int, realizations: int, **changes) -> Config:
    """A fibre bundle under a growing force, thresholds uniform on [0, 2 f_s]."""
    tables = klein_tables(
        slider={"kind": "quasistatic"},
        drive={"force_rate": 1e-6},
        run={"realizations": realizations},
        contacts__count=count,
        contacts__coupling="equal",
        contacts__reattach=False,
        contacts__back_force_ratio=0.0,
        contacts__threshold={"law": "uniform", "relative_width": 1 / math.sqrt(3)},
        **changes,
    )
    del tables["output"]
    return Config.from_dict(tables)


def binned_p_value(sizes: np.ndarray, log_probability, largest: int) -> float:
    """Chi-squared test of sizes, in bins of sizes below a largest one, and one above."""
    edges = np.unique(np.rint(np.geomspace(1, largest, 30)).astype(int))
    below = np.arange(1, edges[-1])
    probability = np.exp(log_probability(below))
    expected = np.add.reduceat(probability, edges[:-1] - 1)
    expected = np.append(expected, 1 - expected.sum()) * len(sizes)
    observed = np.histogram(sizes, np.append(edges, np.inf))[0]
    assert expected.min() > 5
    return float(stats.chisquare(observed, expected).pvalue)


@pytest.mark.usefixtures("few_replicas")
@pytest.mark.parametrize(("ratio", "largest"), [(1.0, 30), (0.1, 1000), long(0.02, 10_000)])
def test_sizes_in_stationary_sliding_are_those_of_a_branching_process(ratio, largest):
    """Exactly so for memoryless thresholds: a break of life l moves the slider by l/(1 + K/Nk)/N,
    in which a Poisson number of contacts break; lives being exponential, their number is geometric
    of mean r = Nk/(K + Nk), and P(s) = C(2s - 2, s - 1)/s p^s q^(s-1), p = 1/(1 + r) = 1 - q."""
    tree = mesoslip.run(sliding(2000.0 * ratio, 100_000))
    sizes = mesoslip.avalanches(tree)["size"].values
    assert len(sizes) == 100_000
    r = 1 / (1 + ratio)

    def log_probability(s: np.ndarray) -> np.ndarray:
        log_binomial = special.gammaln(2 * s - 1) - 2 * special.gammaln(s)
        return log_binomial - np.log(s) + (s - 1) * np.log(r) - (2 * s - 1) * np.log(1 + r)

    assert binned_p_value(sizes, log_probability, largest) > 1e-3
    # The mean size, 1/(1 - r) = 1 + Nk/K, and the share of slip, both exact.
    error = sizes.std() / math.sqrt(len(sizes))
    assert abs(sizes.mean() - (1 + 1 / ratio)) < 4 * error
    summary = mesoslip.avalanche_summary(tree, min_size=10)
    np.testing.assert_allclose(summary["slip_share"], r, rtol=0.02)
    # All breaks but the first of each avalanche: 1 - 1/(1 + Nk/K) = r.
    assert abs(summary["triggered_share"] - r) < 4 * error / sizes.mean() ** 2
    # An exponent of 3/2, and a cutoff that grows as K/(Nk) shrinks.
    assert abs(summary["exponent"] - 1.5) < 4 * summary["exponent_error"]
    cutoff = -1 / math.log(4 * r / (1 + r) ** 2)
    assert abs(summary["cutoff"] - cutoff) < 4 * summary["cutoff_error"]
    if ratio <= 0.1:
        assert summary["exponent_error"] < 0.04
        plain = fit_power_law(sizes, 10, forms=(EXPONENTIAL_CUTOFF,), replicas=0)
        assert abs(plain.exponent - 1.5) < 4 * plain.exponent_error < 0.08


@pytest.fixture(scope="module")
def bundles():
    return mesoslip.run(bundle(200_000, 10))


def test_bursts_of_a_bundle(bundles):
    """All bursts follow the law of Hemmer and Hansen (J. Appl. Mech. 59 (1992) 909)."""
    data = mesoslip.avalanches(bundles)
    is_failure = failures(bundles, data)
    assert is_failure.sum() == 10
    np.testing.assert_allclose(data["size"].values[is_failure] / 200_000, 0.5, atol=0.03)
    sizes = data["size"].values[~is_failure]

    def bursts(s: float) -> float:
        """Bursts of a size over contacts; m = x p(x)/Q(x) = x/(2 - x) up to the failure at 1."""

        def density(x: float) -> float:
            m = x / (2 - x)
            return (1 - m) * math.exp((s - 1) * math.log(m) - s * m) if m > 0 else float(s == 1)

        log_norm = (s - 1) * math.log(s) - special.gammaln(s + 1)
        peak = max(0.0, 1 - 6 / math.sqrt(s))
        parts = [(0.0, peak), (peak, 1.0)]
        log_peak = s  # exp(-s m) with m near 1 is scaled so that nothing underflows
        value = sum(
            integrate.quad(lambda x: density(x) * math.exp(log_peak), *part, epsrel=1e-9)[0]
            for part in parts
        )
        return 0.5 * value * math.exp(log_norm - log_peak)

    edges = [1, 2, 3, 4, 5, 7, 10, 15, 25, 50, 100]
    expected = [sum(bursts(s) for s in range(*pair)) for pair in itertools.pairwise(edges)]
    observed = np.histogram(sizes, edges)[0]
    expected = np.array(expected) * 200_000 * 10
    # Bursts of a bundle are nearly independent.
    chi_squared = np.sum((observed - expected) ** 2 / expected)
    assert stats.chi2.sf(chi_squared, len(expected)) > 1e-3
    fit = fit_power_law(sizes, min_size=20, max_size=1000, replicas=0)
    assert abs(fit.exponent - 2.5) < 4 * fit.exponent_error < 0.3


def test_bursts_near_failure(bundles):
    """Within a thousandth of the strength the exponent is 3/2 (Pradhan, Hansen, Hemmer,
    Phys. Rev. Lett. 95 (2005) 125501)."""
    sizes = mesoslip.avalanches(bundles, min_force_ratio=0.999)["size"].values
    assert len(sizes) > 500
    fit = fit_power_law(sizes, 1, 170, forms=(EXPONENTIAL_CUTOFF,), replicas=0)
    assert abs(fit.exponent - 1.5) < 4 * fit.exponent_error < 0.2


def test_avalanches_near_failure_are_before_it(bundles):
    """The avalanche at the maximum force is the failure."""
    data = mesoslip.avalanches(bundles)
    near = mesoslip.avalanches(bundles, min_force_ratio=0.999)
    for realization in range(10):
        mine, chosen = (
            np.abs(one["force_before"].values[one["realization_index"].values == realization])
            for one in (data, near)
        )
        before = mine[: np.argmax(mine)]
        np.testing.assert_array_equal(chosen, before[before > 0.999 * mine.max()])


def test_strength_of_a_bundle(bundles):
    """N f_s/2, and a little more for few fibres: by 1.255 N^(-2/3) of it (R. L. Smith, Annals of
    Probability 10 (1982) 137)."""
    few = mesoslip.run(bundle(1000, 400))
    for tree, count in ((bundles, 200_000), (few, 1000)):
        data = mesoslip.avalanches(tree)
        owner = data["realization_index"].values
        force = data["force_before"].values
        strengths = np.array([force[owner == one].max() for one in np.unique(owner)]) / 9e-6
        error = strengths.std() / math.sqrt(len(strengths))
        assert abs(strengths.mean() - 1 - 1.255 * count ** (-2 / 3)) < 4 * error < 0.01
        assert tree.attrs["ending"] == "all contacts are broken"


@pytest.mark.usefixtures("few_replicas")
def test_a_force_beyond_what_sliding_contacts_bear_is_reported(command, tmp_path):
    tables = bundle(1000, 1).to_dict()
    tables["contacts"]["reattach"] = True
    tables["run"] = {"duration": 40.0}
    tree = mesoslip.run(tables)
    assert tree.attrs["ending"].startswith("contacts break under the force without end; breaks")
    assert tree.attrs["complete"] == "true"
    # Rebirth makes the contacts no stronger than in their stationary state, within fluctuations.
    steady = mesoslip.derived(tables)["F_steady"].value
    peak = mesoslip.avalanche_summary(tree)["bundle_strength"]
    assert 0.9 * steady < peak < 1.2 * steady
    # The slide without end is no avalanche; and the force curve needs no spring.
    assert mesoslip.avalanches(tree)["size"].values.max() < 1000 * 1000
    assert np.isfinite(mesoslip.curve(tables).attrs["K_star"])
    # So sizes do not add up to the breaks, and it is reported by how many.
    summary = mesoslip.avalanche_summary(tree)
    assert summary["breaks_outside"] > 1000 * 1000
    assert summary["breaks_outside"] + summary["breaks"] == tree["breaks"].item()
    assert "breaks_outside" not in mesoslip.avalanche_summary(tree, after=1e-9)
    path = tmp_path / "slide.nc"
    writing.write(tree, path)
    assert "in sliding without end" in command("avalanches", path)[1]


def test_runs_end_by_avalanches_or_by_the_drive():
    by_count = mesoslip.run(sliding(200.0, 500))
    assert by_count["avalanche_count"].item() == by_count["avalanches"].sizes["avalanche"] == 500
    assert by_count.attrs["ending"] == "number of avalanches reached"
    assert "breaks_outside" not in mesoslip.avalanche_summary(by_count)
    tables = sliding(200.0, 500).to_dict()
    start = by_count["drive_displacement"].values[0, 0]
    tables["run"] = {"drive_displacement": 2e-10}
    by_way = mesoslip.run(tables)
    assert by_way.attrs["ending"] == "end of the drive"
    np.testing.assert_allclose(by_way["drive_displacement"].values[0, -1] - start, 2e-10, rtol=1e-6)
    # The same run as far as both go.
    shared = min(500, by_way["avalanches"].sizes["avalanche"])
    assert shared > 50
    for name in ("start_time", "size", "slip"):
        np.testing.assert_array_equal(
            by_count["avalanches"][name].values[:shared], by_way["avalanches"][name].values[:shared]
        )


def test_small_avalanches_may_be_left_out():
    everything = mesoslip.run(sliding(200.0, 2000))
    tables = sliding(200.0, 2000).to_dict()
    tables["output"] = {"avalanche_size": 20}
    large = mesoslip.run(tables)
    sizes = everything["avalanches"]["size"].values
    np.testing.assert_array_equal(large["avalanches"]["size"].values, sizes[sizes >= 20])
    assert large["avalanche_count"].item() == 2000


@pytest.mark.parametrize(
    "contacts", [{}, THERMAL | {"contacts__thermal": {"rate": 1.0, "force_ratio": 0.01}}]
)
def test_each_contact_counts_once_in_an_area(contacts):
    """Contacts of the first generation of an avalanche break again in it."""
    changes = FAST | contacts | {"interaction": PLACES | {"strength": 0.0}}
    changes |= {"slider": {"kind": "quasistatic", "stiffness": 20.0}, "drive": {"velocity": 1e-5}}
    tree = mesoslip.run(klein_tables(**changes | {"run__duration": 0.2}))
    area, size, generations = (
        tree["avalanches"][name].values for name in ("area", "size", "generations")
    )
    assert (size > area).any()
    assert np.all((area >= 1) & (area <= np.minimum(size, PLACES["columns"] * PLACES["rows"])))
    assert np.all((generations >= 1) & (generations <= size))


def test_stick_slip_by_interaction(klein):
    """S25: smooth at xi = 0, at 0.3 one avalanche through the system, and no force after it."""
    largest, drops = [], []
    for strength in (0.0, 0.03, 0.1, 0.3):
        config = klein(
            contacts__stiffness=200.0,
            contacts__threshold__relative_width=0.3,
            interaction={"strength": strength, "columns": 60, "rows": 68},
            output__slip_interval=1e-5,
            run__duration=6.0,
        )
        tree = mesoslip.run(config)
        data = mesoslip.avalanches(tree)
        largest.append(data["size"].values.max())
        late = tree["spring_force"].values[0][tree["time"].values > 4]
        drops.append(np.ptp(late) / 18e-6)
    assert largest[0] == 1
    assert np.all(np.diff(largest) > 0)
    assert drops[0] < 0.1 < drops[3]
    first = data.isel(avalanche=int(np.argmax(data["size"].values)))
    slip = mesoslip.slips(tree).isel(slip=0)
    assert abs(slip["start_time"].item() - first["start_time"].item()) < 1e-3
    assert first["size"].item() > 0.85 * 4080
    assert first["spans"].item() == 1
    after = tree["slip_traces"].to_dataset()
    inside = (after["sample_time"].values > first["start_time"].item()) & (
        after["sample_time"].values < first["start_time"].item() + 3e-4
    )
    assert inside.sum() > 20
    assert np.max(np.abs(after["contact_force"].values[inside])) < 0.01 * 18e-6


@pytest.mark.usefixtures("few_replicas", "quick_pictures")
def test_commands(tmp_path, command):
    config = tmp_path / "small.toml"
    tables = klein_tables(
        contacts__stiffness=200.0,
        contacts__threshold__relative_width=0.3,
        contacts__count=240,
        interaction={"strength": 0.1, "columns": 20, "rows": 12},
        output={"interval": 1e-3, "snapshots": [1.0, 2.5], "snapshot_size": 30},
        run={"duration": 3.0},
    )
    config.write_text(Config.from_dict(tables).to_toml())
    output = tmp_path / "small.nc"
    command("run", config, "-o", output, "--quiet")
    shown = command.output("avalanches", output, "--csv", tmp_path / "small.csv")
    assert "exponent" in shown
    assert "P(s)" in shown
    header = (tmp_path / "small.csv").read_text().splitlines()[0]
    assert header.startswith("realization_index [1],start_time [s],displacement [m],size [1]")
    answer = json.loads(command.output("avalanches", output, "--json", "--after", "2 s"))
    times = mesoslip.avalanches(output, after=2.0)["start_time"].values
    assert answer["statistics"]["count"] == len(times) > 0
    assert sum(one["count"] for one in answer["distribution"]) == len(times)
    assert times.min() >= 2
    assert answer["ccdf"]["part_at_least"][0] == 1

    for name, words in (
        ("run.png", ()),
        ("sizes.png", ("--view", "avalanches")),
        ("lattice.png", ("--view", "lattice")),
        ("start.png", ("--view", "lattice", "--snapshot", "0")),
        ("spread.gif", ()),
    ):
        command("plot", output, "-o", tmp_path / name, *words)
        assert (tmp_path / name).stat().st_size > 3000
    assert not list(tmp_path.glob(".*"))
    lattice = ("plot", output, "-o", tmp_path / "no.png", "--view", "lattice")
    message = command.refusal(*lattice, "--snapshot", "99")
    assert message.startswith("mesoslip:")
    assert "snapshot 99" in message
    message = command.refusal("avalanches", output, "--after", "2 kg")
    assert message.startswith("mesoslip: --after")

    plain = tmp_path / "plain.nc"
    changes = ("--set", "output.snapshot_size=100000", "--set", "output.snapshots=[]")
    command("run", config, "-o", plain, "--quiet", *changes)
    assert "output.snapshot_size" in command.refusal("plot", plain, "-o", tmp_path / "no.gif")
