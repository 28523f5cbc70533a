"""A helm moves a robot while a page reports what its person holds, and by nothing else."""

import pytest

from holozen.view.helm import ENDS, HELD, OTHER, SETTLING, SILENT, Helm

FORWARD, LEFT = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


@pytest.fixture
def helm() -> Helm:
    """A helm that page 1 holds by its first press, since 0 s."""
    helm = Helm()
    assert helm.motion is None
    assert helm.hold(1, 1, FORWARD, 0.0)
    return helm


def test_what_is_held_is_commanded_until_it_is_let_go_which_begins_a_stop(helm: Helm) -> None:
    assert helm.motion == FORWARD and helm.page == 1 and helm.stopping_since(0.1) is None
    assert helm.hold(1, 1, LEFT, 0.1) and helm.motion == LEFT
    assert helm.let_go(1, 1, 0.2)
    assert helm.motion is None and helm.page is None
    assert helm.stopping_since(0.2 + SETTLING - 0.01) == 0.2
    assert helm.stopping_since(0.2 + SETTLING + 0.01) is None
    helm.rest()
    assert helm.stopping_since(0.3) is None


def test_a_press_that_was_let_go_never_counts_again(helm: Helm) -> None:
    helm.let_go(1, 1, 0.1)
    assert not helm.hold(1, 1, FORWARD, 0.2), "it came out of a buffer"
    assert helm.hold(1, 2, FORWARD, 0.3)
    assert not helm.let_go(1, 1, 0.4) and helm.motion == FORWARD, "so did the end of an older one"


def test_silence_is_a_stop_after_which_only_a_new_press_counts(helm: Helm) -> None:
    helm.expire(HELD - 0.01)
    assert helm.motion == FORWARD
    helm.expire(HELD + 0.01)
    assert helm.motion is None and helm.dropped(1) == (1, SILENT) and helm.dropped(1) is None
    assert not helm.hold(1, 1, FORWARD, HELD + 0.02)
    assert helm.hold(1, 2, FORWARD, HELD + 0.03)


def test_a_report_after_silence_does_not_go_on_with_what_was_held_before(helm: Helm) -> None:
    assert not helm.hold(1, 1, FORWARD, HELD + 0.01)
    assert helm.motion is None


def test_one_page_drives_until_it_lets_go_or_is_gone(helm: Helm) -> None:
    assert not helm.hold(2, 1, LEFT, 0.01) and helm.dropped(2) == (1, OTHER)
    helm.close(2, 0.02)
    assert helm.motion == FORWARD
    helm.close(1, 0.03)
    assert helm.motion is None and helm.stopping_since(0.03) == 0.03
    assert helm.hold(2, 1, LEFT, 0.04)


def test_a_press_that_was_refused_does_not_drive_once_the_other_page_lets_go(helm: Helm) -> None:
    helm.hold(2, 1, LEFT, 0.01)
    helm.let_go(1, 1, 0.02)
    assert not helm.hold(2, 1, LEFT, 0.03)
    assert helm.hold(2, 2, LEFT, 0.04)


def test_another_page_lets_go_of_nothing_but_its_own(helm: Helm) -> None:
    assert not helm.let_go(2, 9, 0.01)
    assert helm.motion == FORWARD


def test_after_its_end_nothing_counts(helm: Helm) -> None:
    helm.end(0.1)
    assert helm.motion is None and helm.stopping_since(0.1) == 0.1
    assert not helm.hold(1, 2, FORWARD, 0.2) and helm.dropped(1) == (2, ENDS)
