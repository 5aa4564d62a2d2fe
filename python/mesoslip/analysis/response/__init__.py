"""Steady forces, velocity steps, holds and rate-and-state parameters of outputs.

Forces are those of the spring along the drive: positive against its motion, in either direction.
Of a slider under a force: creep velocities and static friction.
"""
