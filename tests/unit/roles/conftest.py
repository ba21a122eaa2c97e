"""Plans of manager_run; modules that need another plan have their own fixture of that name."""

from __future__ import annotations

import pytest
from manager_run import ELSEWHERE, TEXT, plan_of

from wall.roles.plan import Plan


@pytest.fixture(scope="module")
def plan() -> Plan:
    return plan_of(TEXT)


@pytest.fixture(scope="module")
def elsewhere() -> Plan:
    """Of a panel that compositor 1 shows in a window."""
    return plan_of(f"{TEXT}{ELSEWHERE}")
