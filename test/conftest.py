# SPDX-License-Identifier: Apache-2.0
"""For all tests."""

from __future__ import annotations

try:
    from hypothesis import settings
except ImportError:
    pass  # the tests that need it skip themselves
else:
    # A test that first waits for the compiler, or runs on a slow machine, is no failure.
    settings.register_profile("patient", deadline=None)
    settings.load_profile("patient")
