# SPDX-License-Identifier: Apache-2.0
"""What happens on the table, step by step: plain functions over records that Python interprets and Numba compiles.

A module here imports nothing of the project but modules of this package. Start reading at `loop.run_until`.
"""
