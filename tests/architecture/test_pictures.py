"""The picture of the docs shows what there is."""

from scripts.pictures import NOTE, made_of


def test_the_picture_is_not_older_than_what_it_shows() -> None:
    assert NOTE.read_text().strip() == made_of(), "run scripts/pictures, and look at docs/view.png"
