"""A slider with a length: blocks in a row, each with its own contacts (model section 16)."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from mesoslip.configuration.sliders.base import Notes, Setting
from mesoslip.configuration.sliders.inertial import (
    SLIP_VELOCITY_RATIO,
    InertialSlider,
    SetupDamping,
)
from mesoslip.configuration.table import (
    Complaint,
    Complaints,
    Length,
    Rate,
    Stiffness,
    Whole,
    choice,
)
from mesoslip.quantities import with_unit

# Springs of the drive: at the first block, from above on every block, or both.
LOADINGS = ("edge", "top", "both")
# Damping rate between neighbours over their frequency above which it makes motion stiff.
STIFF_DAMPING = 30.0


class InterfaceSlider(SetupDamping, InertialSlider):
    """Blocks in a row, joined by springs, each on its own contacts; both ends are free.

    The drive pulls the first block by a spring, or every block by a spring from above, or both.
    One block is a rigid slider.
    """

    kind: Literal["interface"] = "interface"
    """Blocks in a row, each with its own contacts."""
    blocks: Annotated[Whole, Field(ge=1, le=100_000)]
    """Number of blocks, N_b; contacts.count is a multiple of it."""
    length: Annotated[Length, Field(gt=0)]
    """Length of the interface; blocks are length/N_b apart."""
    bar_stiffness: Annotated[Stiffness, Field(gt=0)] | None = None
    """Stiffness of the row of blocks as a whole, K_b: springs of K_b N_b join neighbours. Without
    effect on a single block."""
    neighbour_damping: Annotated[Rate, Field(ge=0)] = 0.0
    """Rate γ of the damping between neighbours, γ M/N_b times their relative velocity. Without
    effect on a single block."""
    loading: Annotated[str, choice(LOADINGS)] = "edge"
    """Springs of the drive: `edge`, at the first block; `top`, from above on every block;
    `both`."""
    stiffness: Annotated[Stiffness, Field(gt=0)] | None = None
    """Stiffness of the drive's spring at the first block, K; with loading `edge` and `both`."""
    top_stiffness: Annotated[Stiffness, Field(gt=0)] | None = None
    """Stiffness of all springs from above together, K_t; with loading `top` and `both`."""

    @property
    def edge_stiffness(self) -> float:
        """K [N/m]; 0 without a spring at the edge."""
        return 0.0 if self.loading == "top" else self.stiffness or 0.0

    @property
    def total_top_stiffness(self) -> float:
        """K_t [N/m]; 0 without springs from above."""
        return 0.0 if self.loading == "edge" else self.top_stiffness or 0.0

    @property
    def springs_from_above(self) -> bool:
        return self.total_top_stiffness > 0

    @property
    def spring_stiffness(self) -> float:
        return self.edge_stiffness + self.total_top_stiffness

    @property
    def damping_rate(self) -> float:
        """η_S [1/s]."""
        return self.damping_rate_at(self.omega_s)

    @property
    def block_mass(self) -> float:
        """m_b = M/N_b [kg]."""
        return self.mass / self.blocks

    @property
    def neighbour_spring(self) -> float:
        """k_b = K_b N_b [N/m]; 0 for a single block."""
        return 0.0 if self.blocks == 1 else (self.bar_stiffness or 0.0) * self.blocks

    @property
    def block_spacing(self) -> float:
        """a [m]."""
        return self.length / self.blocks

    @property
    def neighbour_frequency(self) -> float:
        """√(k_b/m_b) [1/s], the inverse of the time in which sound passes a block."""
        return math.sqrt(self.neighbour_spring / self.block_mass)

    @property
    def block_time(self) -> float:
        return 0.0 if self.blocks == 1 else 1 / self.neighbour_frequency

    @property
    def sound_velocity(self) -> float:
        """c = a √(k_b/m_b) [m/s]."""
        return self.block_spacing * self.neighbour_frequency

    @property
    def moves_as_one(self) -> bool:
        """Whether alike contacts in all blocks move alike, as those of a rigid slider."""
        return self.blocks == 1 or self.loading == "top"

    @property
    def block_count(self) -> int:
        return self.blocks

    def kernel_parameters(self, config: Setting) -> dict[str, float | str]:  # noqa: ARG002
        return {
            "blocks": self.blocks,
            "mass": self.mass,
            "neighbour_spring": self.neighbour_spring,
            "neighbour_damping": 0.0 if self.blocks == 1 else self.neighbour_damping,
            "edge_stiffness": self.edge_stiffness,
            "top_stiffness": self.total_top_stiffness,
            "damping": self.damping_rate,
        }

    def slip_velocity(self, config: Setting) -> float:
        if config.output.slip_velocity or self.blocks == 1:
            return super().slip_velocity(config)
        # A block that loses its static force moves with that over its impedance; a slip of all
        # blocks may be slower.
        block = config.contacts.static_force / self.blocks * float(config.block_shares.min())
        impedance = self.block_mass * self.neighbour_frequency
        return SLIP_VELOCITY_RATIO * min(block / impedance, self.velocity_scale(config))

    @property
    def caveat(self) -> str | None:
        if self.moves_as_one:
            return None
        return (
            f'with slider.loading = "{self.loading}" blocks do not move together: force curve and '
            "K* are those of a rigid slider on all springs of the drive; only a run shows fronts"
        )

    def notes(self, config: Setting) -> Notes:
        if self.blocks == 1:
            return
        crossing = self.length / self.sound_velocity
        interval = config.output.interval or config.expected_duration / 10000
        if interval > crossing:
            yield (
                f"sound crosses the interface in {with_unit(crossing, 's')}, less than the "
                f"interval of the trace, {with_unit(interval, 's')}: blocks are recorded before "
                "and after a front, not during it; fronts are in the groups ruptures and fronts, "
                "whatever the interval"
            )
        if self.neighbour_damping > STIFF_DAMPING * self.neighbour_frequency:
            yield (
                f"slider.neighbour_damping = {self.neighbour_damping:g} 1/s is "
                f"{self.neighbour_damping / self.neighbour_frequency:.3g} times the frequency of "
                "neighbours: sound is overdamped, and steps are short"
            )
        if self.neighbour_damping == self.damping_rate == 0:
            yield (
                "the row of blocks has no damping: pinned blocks ring without end, slips of blocks "
                "may never be over, and steps are short all the time; slider.neighbour_damping or "
                "slider.damping_ratio ends that"
            )

    def problems(self, config: Setting) -> Complaints:
        for key, loadings, place in (
            ("stiffness", ("edge", "both"), "at the first block"),
            ("top_stiffness", ("top", "both"), "from above"),
        ):
            value = getattr(self, key)
            if value is None and self.loading in loadings:
                yield Complaint(
                    f"slider.{key}", f'missing: loading = "{self.loading}" has springs {place}'
                )
            elif value is not None and self.loading not in loadings:
                yield Complaint(
                    f"slider.{key}",
                    f'is not for loading = "{self.loading}", which has no springs {place}; leave '
                    'it out, or use loading = "both"',
                    value,
                )
        if self.blocks > 1 and self.bar_stiffness is None:
            yield Complaint("slider.bar_stiffness", "missing: it joins the blocks")
        if config.contact_kind.has_neighbours or config.contact_kind.on_lattice:
            yield Complaint(
                "interaction",
                "is not for an interface with a length: its contacts have no sites on a lattice, "
                "and act on each other by the blocks",
            )
        sites = config.contact_kind.site_count(config.contacts)
        count = config.contacts.count
        if count % self.blocks:
            yield Complaint(
                "contacts.count",
                f"must be a multiple of slider.blocks = {self.blocks}, such as "
                f"{self.blocks * max(1, round(count / self.blocks))}",
                count,
            )
        elif sites % self.blocks and config.pressing.profile is None:
            yield Complaint(
                "load",
                f"at its maximum there are {sites} contacts, which must be a multiple of "
                f"slider.blocks = {self.blocks}",
            )
        if config.output.snapshots or config.output.snapshot_size:
            yield Complaint(
                "output.snapshots",
                "are not recorded of an interface with a length; its blocks are, with the trace",
            )
