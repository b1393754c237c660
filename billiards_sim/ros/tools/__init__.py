# SPDX-License-Identifier: Apache-2.0
"""Clients of the node: `shoot`, `demo`, and what draws and measures it."""
