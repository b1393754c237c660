# SPDX-License-Identifier: Apache-2.0
"""What the tests of pictures and movies need and a robot need not have."""

import importlib.util

import pytest

MISSING = [
    module for module in ("matplotlib", "PIL", "tqdm", "imageio_ffmpeg") if importlib.util.find_spec(module) is None
]

needs_plot_extra = pytest.mark.skipif(bool(MISSING), reason=f"needs the extra plot: no {', '.join(MISSING)}")
