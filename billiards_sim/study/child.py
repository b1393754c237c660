# SPDX-License-Identifier: Apache-2.0
"""Calls a function in this process and prints its result as JSON: the other end of `measure.in_child`."""

from __future__ import annotations

import importlib
import json
import sys

from billiards_sim.engine.machine import compile

if __name__ == "__main__":
    compile()
    module, _, function = sys.argv[1].partition(":")
    result = getattr(importlib.import_module(module), function)(**json.loads(sys.argv[2]))
    print(json.dumps(result))
