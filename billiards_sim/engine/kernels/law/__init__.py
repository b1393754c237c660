# SPDX-License-Identifier: Apache-2.0
"""The laws of impact, one effect a file: its source, its derivation, its coefficients and its kernels."""
