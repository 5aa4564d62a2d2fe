"""
A measured velocity step
========================

Basalt gouge at 20 MPa, a step from 3 to 10 µm/s. Step and velocities are found in the
displacement of the load point, which was recorded at 10 Hz before the step and at 100 Hz after
it; the stiffness is fitted. ``mesoslip example measured/basalt-step`` writes the description with
the data.

Data: Giacomel, Faulkner, Lambert, Allen, *steadystate*, Geosphere (2024), doi 10.1130/GES02739.1;
repository pgiacomel/steadystate, MIT.
"""

import mesoslip

tree = mesoslip.read_trace("basalt-step.toml")
mesoslip.plot(tree, view="response")
