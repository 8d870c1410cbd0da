"""Tests of the page skip where its library is missing."""

import pytest

pytest.importorskip("viser", reason="the extra `live` is not installed")
