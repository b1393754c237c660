# SPDX-License-Identifier: Apache-2.0
"""Studies and pictures made with the engine."""
