# SPDX-License-Identifier: Apache-2.0
"""A table in the browser: a small server, what it speaks with the page, and the page itself."""
