"""Commands that print catalogues of an output: slips, avalanches, events, strokes, plateaus."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Annotated, Any, TypeVar

import typer

from mesoslip.command_line.options import (
    JsonOption,
    LatexOption,
    OutputArgument,
    RevolutionOption,
    TableOption,
    counted,
    format_option,
    option,
    positive_or_none,
    print_json,
    print_table,
    revolution_of,
    share,
    show,
    show_all,
    show_catalogue,
    time_of,
    write_table,
)
from mesoslip.quantities import with_error

# Numbers of rows that are printed of a table with many more, at its beginning and end.
FIRST, LAST = 20, 5
MANY = 60
Row = TypeVar("Row")


def ends_of(rows: Sequence[Row], gap: Row) -> Sequence[Row]:
    """Rows of a table for print; of many the first and the last with a gap between them."""
    return rows if len(rows) <= MANY else [*rows[:FIRST], gap, *rows[-LAST:]]


def slips(output: OutputArgument, table: TableOption = None, as_json: JsonOption = False) -> None:
    """Print the catalogue of slips, with statistics."""
    from mesoslip.analysis import slips as catalogues
    from mesoslip.output import files, targets

    targets.check_writable(table, [output])
    with files.opened_arrays(output) as tree:
        catalogue, counts = catalogues.catalogue_of(tree), catalogues.counts(tree)
    for_print = catalogue.printed()
    write_table(table, lambda: [for_print], catalogue.write_csv)
    rows = catalogue.rows
    if as_json:
        answer = {"slips": rows, "statistics": catalogue.statistics}
        print_json(answer if counts is None else answer | {"slip_counts": counts})
        return
    shown = ends_of(for_print.rows, ("…",) * len(for_print.head))
    print_table((for_print.head, *shown))
    rest = (
        f": the first {FIRST} and the last {LAST}; all"
        if len(shown) < len(rows)
        else "; all columns"
    )
    typer.echo(f"{counted(len(rows), 'slip')}{f'{rest} with --csv FILE' if rows else ''}")
    if rows:
        statistics = catalogue.printed_statistics()
        typer.echo("")
        print_table((statistics.head, *statistics.rows))
        if catalogue.goes_back:
            typer.echo(
                "slips backwards have negative forces; statistics are along the motion of each slip"
            )
    if counts is not None:
        _print_counts(counts, catalogue.force_unit)


def _print_counts(counts: dict[str, Any], unit: str) -> None:
    """Print the number of slips over the minimum fall, with a warning if it has no plateau."""
    from mesoslip.analysis import slips as catalogues

    if not counts["min_fall"]:
        return
    table = catalogues.printed_counts(counts, unit)
    typer.echo("")
    print_table((table.head, *table.rows))
    if counts["plateau"] is None and any(counts["slip_count"]):
        typer.echo(
            "warning: the number of slips depends on the minimum fall everywhere; falls that stand "
            "out of the noise are counted"
        )


def avalanches(
    output: OutputArgument,
    table: TableOption = None,
    as_json: JsonOption = False,
    min_size: Annotated[
        int | None,
        option("Minimum size in the fit; chosen from the data by default", "SIZE", min=1),
    ] = None,
    after: Annotated[str, option("Only avalanches after this time, such as '2 s'", "TIME")] = "0 s",
    min_force_ratio: Annotated[
        float | None,
        option(
            "Only avalanches at more than this fraction of the maximum contact force, and "
            "before that maximum",
            "RATIO",
            min=0,
            max=1,
        ),
    ] = None,
) -> None:
    """Print the sizes of avalanches, and the fitted power law."""
    from mesoslip.analysis import avalanches as avalanche_catalogue
    from mesoslip.analysis.avalanche_sizes import ccdf, logarithmic_bins
    from mesoslip.output import files, targets

    targets.check_writable(table, [output])
    tree = files.read_run(output)
    start = time_of(after, "--after")
    data = avalanche_catalogue.avalanches(tree, after=start, min_force_ratio=min_force_ratio)
    write_table(
        table,
        lambda: [avalanche_catalogue.printed(data)],
        lambda file: avalanche_catalogue.write_csv(data, file),
    )
    statistics = avalanche_catalogue.avalanche_summary(
        tree, after=start, min_force_ratio=min_force_ratio, min_size=min_size
    )
    bins = logarithmic_bins(data["size"].values)
    ends = bins.edges[:, 0] + 0.5, bins.edges[:, 1] - 0.5
    columns = (*ends, bins.count, bins.density.tolist(), bins.density_error.tolist())
    distribution = [
        {"from": int(low), "to": int(high), "count": int(count), "density": density, "error": error}
        for low, high, count, density, error in zip(*columns, strict=True)
    ]
    if as_json:
        sizes, part = ccdf(data["size"].values)
        cumulative = {"size": sizes.tolist(), "part_at_least": part.tolist()}
        answer = {"statistics": statistics, "distribution": distribution, "ccdf": cumulative}
        print_json(answer)
        return
    rows = [["size from", "to", "count", "probability P(s)"]]
    for one in distribution:
        counts = [str(one[name]) for name in ("from", "to", "count")]
        rows.append([*counts, with_error(one["density"], one["error"])])
    print_table(rows)
    show_all(statistics, avalanche_catalogue.SUMMARY)
    warning = avalanche_catalogue.warning(statistics)
    if warning is not None:
        typer.echo(f"warning: {warning}")


def regime(output: OutputArgument, as_json: JsonOption = False) -> None:
    """Print the regime: smooth, stick-slip, irregular or transient."""
    from mesoslip.analysis.regime.outputs import judge
    from mesoslip.analysis.regime.result import NAMES, REGIME, summary
    from mesoslip.output import files

    with files.opened_arrays(output) as tree:
        results, motion = judge(tree, str(output))
        realizations = tree.to_dataset()["realization"].values.tolist()
    if as_json:
        rows = [
            {**one.row, "realization": number, "regime": NAMES[one.regime]}
            for number, one in zip(realizations, results, strict=True)
        ]
        print_json(rows)
        return
    if motion is not None:
        typer.echo(f"a slider under a force has no cycles; in its last stage it {motion}")
        typer.echo("mesoslip response prints creep and static friction")
        return
    shown = ends_of(list(zip(realizations, results, strict=True)), None)
    for pair in shown:
        if pair is None:
            typer.echo(f"… ({len(results) - len(shown) + 1} others, all with --json)")
            continue
        index, one = pair
        if len(results) > 1:
            typer.echo(f"realization {index}")
        for name, meaning in REGIME.items():
            if name == "regime" or name.endswith("_error"):
                continue
            error = getattr(one, f"{name}_error", None)
            show(name, one.row[name], meaning.units, one.long_name(name), error)
        typer.echo(one.summary)
    if len(results) > 1:
        typer.echo(summary(results))


def fronts(
    output: OutputArgument,
    table: TableOption = None,
    as_json: JsonOption = False,
    as_latex: Annotated[
        bool, format_option("--latex", "Print the statistics by kind as a LaTeX table")
    ] = False,
) -> None:
    """Print fronts and precursors of an interface with a length."""
    from mesoslip.analysis.fronts import fronts_of

    find = partial(fronts_of, name=str(output))
    found = show_catalogue(output, find, table, as_json=as_json, as_latex=as_latex)
    sentence = None if as_json or as_latex else found.size_sentence()
    if sentence is not None:
        typer.echo(f"\n{sentence}")


def events(
    output: OutputArgument,
    table: TableOption = None,
    as_json: JsonOption = False,
    as_latex: LatexOption = False,
    catalogue: Annotated[
        str | None,
        option(
            "Catalogue: slips, avalanches, or channel, the last of these by default",
            "CATALOGUE",
            "--of",
        ),
    ] = None,
    threshold: Annotated[
        float | None,
        option(
            "Minimum amplitude of an event of the channel; from its noise by default",
            "NUMBER",
            min=0,
        ),
    ] = None,
    completeness: Annotated[
        float | None, option("Minimum log10(size) of the b-value; found by default", "NUMBER")
    ] = None,
    main_size: Annotated[
        float | None,
        option("Minimum size of main events; the largest 5 % by default", "SIZE", min=0),
    ] = None,
) -> None:
    """Print b-value and Omori decay of events, and acoustic emission.

    Acoustic emission is compared with the slips of a trace.
    """
    from mesoslip.analysis.events import summary as analysis
    from mesoslip.configuration.arguments import check_choice

    check_choice("--of", catalogue, analysis.CATALOGUES)
    find = partial(
        analysis.events_of,
        catalogue=catalogue,
        threshold=threshold,
        completeness=completeness,
        main_size=main_size,
        name=str(output),
    )
    show_catalogue(output, find, table, as_json=as_json, as_latex=as_latex)


def plateaus(
    output: OutputArgument,
    table: TableOption = None,
    as_json: JsonOption = False,
    as_latex: LatexOption = False,
    signal: Annotated[
        str | None,
        option(
            "Signal whose steps cut the record: speed, load or force; by default speed and "
            "load where they have steps",
            "SIGNAL",
        ),
    ] = None,
    viscosity: Annotated[
        str | None,
        option("Viscosity of the lubricant, such as '90 mPa*s', for a Stribeck curve", "VISCOSITY"),
    ] = None,
) -> None:
    """Print the friction of each plateau of a record.

    Plateaus lie between steps of speed, load or force.
    """
    from mesoslip.analysis.plateaus import catalogue as analysis
    from mesoslip.configuration.arguments import check_choice

    check_choice("--signal", signal, analysis.SIGNALS)
    lubricant = positive_or_none(viscosity, "--viscosity", "Pa*s", "90 mPa*s")
    find = partial(analysis.plateaus_of, signal=signal, viscosity=lubricant, name=str(output))
    show_catalogue(output, find, table, as_json=as_json, as_latex=as_latex)


def strokes(
    output: OutputArgument,
    table: TableOption = None,
    as_json: JsonOption = False,
    as_latex: Annotated[
        bool, format_option("--latex", "Print the means over cycles as a LaTeX table")
    ] = False,
    middle: Annotated[
        str, option("Share of a stroke over which friction is averaged, in its middle", "SHARE")
    ] = "80%",
    period: RevolutionOption = None,
) -> None:
    """Print strokes, cycles and revolutions of a reciprocating record.

    The record goes back and forth, or is that of a disc.
    """
    from mesoslip.analysis.strokes import catalogue as analysis

    part = share(middle, "--middle")
    time = revolution_of(period)
    find = partial(analysis.strokes_of, middle=part, name=str(output), period=time)
    show_catalogue(output, find, table, as_json=as_json, as_latex=as_latex, latex_table=-1)
