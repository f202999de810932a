"""What all robots of a drive must have in common, and what is said if they do not.

In the thesis (section 7.2.2) two teams once started different scenarios, and their robots ran into each other.
"""

import hashlib
from collections.abc import Mapping

import mp2a
from mp2a.exceptions import InputError
from mp2a.formation.choreography import scenario as scenarios
from mp2a.formation.choreography.scenario import Scenario
from mp2a.formation.robot_models import RobotModel

Terms = Mapping[str, str]
"""What is compared, as text by name."""


def terms_of(scenario: Scenario, models: Mapping[str, RobotModel], max_speed: float) -> dict[str, str]:
    """Return what a robot drives by, as far as it must be the same for all.

    Parameters
    ----------
    scenario
        Goes in as a digest of its text, in which neither comments nor blanks count.
    models
        By role; each works out where the others are from their sizes and limits.
    max_speed
        v_max of the virtual leaders, m/s.
    """
    digest = hashlib.sha256(scenarios.format(scenario).encode()).hexdigest()
    return {
        "mp2a": mp2a.__version__,
        "scenario": f"digest {digest[:12]}",
        "v_max": f"{max_speed!r} m/s",
        **{f"model of {role}": _text(model) for role, model in models.items()},
    }


def check_terms(role: str, own: Terms, other_role: str, others: Terms) -> None:
    """Refuse to start with a robot that drives by something else.

    Raises
    ------
    InputError
        If anything differs; the message names what, and both values.
    """
    names = [name for name in {**own, **others} if own.get(name) != others.get(name)]
    if names:
        differing = "; ".join(
            f"{name}: {own.get(name, 'none')} for {role}, {others.get(name, 'none')} for {other_role}" for name in names
        )
        raise InputError(f"start: {role} and {other_role} were not given the same, expected no difference: {differing}")


def _text(model: RobotModel) -> str:
    numbers = (f"{name} {value!r}" for name, value in vars(model).items() if name != "name")
    return ", ".join((model.name, *numbers))
