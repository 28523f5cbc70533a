"""What may run at the same time."""

from holozen.ros.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup


class Entity:
    """Something with a callback."""


def test_of_an_exclusive_group_one_runs_at_a_time() -> None:
    group, one, other = MutuallyExclusiveCallbackGroup(), Entity(), Entity()
    assert group.can_execute(one)
    assert group.beginning_execution(one)
    assert not group.can_execute(other)
    assert not group.beginning_execution(one)
    group.ending_execution(one)
    assert group.can_execute(other)


def test_of_a_reentrant_group_all_run() -> None:
    group, one = ReentrantCallbackGroup(), Entity()
    assert group.beginning_execution(one)
    assert group.can_execute(one)
    assert group.beginning_execution(one)
    group.ending_execution(one)


def test_a_group_knows_its_members_while_they_live() -> None:
    group, one = ReentrantCallbackGroup(), Entity()
    group.add_entity(one)
    assert group.has_entity(one)
    assert not group.has_entity(Entity())
    del one
    assert len(group.entities) == 0
