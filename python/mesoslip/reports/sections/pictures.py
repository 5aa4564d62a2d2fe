"""Pictures of outputs."""

from __future__ import annotations

from collections.abc import Sequence

from mesoslip.output.access import group_of
from mesoslip.output.kinds import kind_of
from mesoslip.plots import draw
from mesoslip.plots.extent import Extent
from mesoslip.plots.snapshots import is_on_lattice
from mesoslip.plots.views import view_of
from mesoslip.plots.views.base import Options
from mesoslip.reports.content import PARTS, Block, Section, Subject
from mesoslip.reports.sections.base import picture_of, picture_of_all


def pictures(subjects: Sequence[Subject]) -> Section:
    """Views of outputs: all of them over each other, and each alone."""
    options = draw.NO_OPTIONS
    if kind_of(subjects[0].tree) == "run":
        options = Options(Extent(parts=PARTS))
    blocks: list[Block] = []
    if len(subjects) > 1:
        blocks.append(picture_of_all(subjects, "All outputs over each other", options=options))
    for subject in subjects:
        tree = subject.tree
        view = view_of(tree, None, options)
        summary = view.summary if view.caption is None else view.caption(tree)
        caption = f"{summary[0].upper()}{summary[1:]}"
        blocks.append(picture_of(subjects, subject, caption, options=options))
        if "layer_displacement" in tree.data_vars:
            caption = "Waves in the slider during its largest slip"
            blocks.append(picture_of(subjects, subject, caption, "layers", options))
        if "snapshots" in tree.children and group_of(tree, "snapshots").sizes["snapshot"]:
            caption, name = "Stretches of the contacts and their thresholds", "contacts"
            if is_on_lattice(group_of(tree, "snapshots")):
                caption, name = "Contacts on their lattice", "lattice"
            blocks.append(picture_of(subjects, subject, caption, name))
    return Section("Pictures", tuple(blocks))
