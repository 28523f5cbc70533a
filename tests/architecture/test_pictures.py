"""The pictures of the docs show what there is."""

import pytest

from scripts.pictures import PICTURES, made_of, notes
from tests.present import needs


@needs("view")
@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_not_older_than_what_it_shows(name: str) -> None:
    assert notes().get(name) == made_of(name), f"run scripts/pictures, and look at docs/{name}"
