# SPDX-License-Identifier: Apache-2.0
"""Elastic contacts: what bodies do that press each other for a while, by `law.hertz`.

Rigid impacts have no duration, so a shock passes through a rack pair by pair. Real ones last for 0.2 to 0.4 ms and
overlap in time. Balls that touch each other form an island with all whom they touch (`touch`). It goes on by short
steps, each an event (`phase`), over which the forces are integrated (`step`); in between each ball follows a parabola,
so all is as for a free ball: others may run into it, and time may be cut anywhere. A pair that nobody else can reach
meanwhile needs no steps (`alone`). Where all is slow the rigid rules take over, with balls that are just clear of each
other (`apart`).
"""
