"""ament_index_python finds packages by their sources, and where they are installed."""

from pathlib import Path

import pytest

from holozen.ros import ament_index_python as ament
from holozen.ros import packages

from .conftest import Write


def test_a_package_is_found_by_its_sources(my_bot: Path) -> None:
    assert ament.get_package_share_directory("my_bot") == str(my_bot)
    assert ament.get_package_share_path("my_bot") == my_bot
    assert ament.get_package_prefix("my_bot") == str(my_bot)
    assert ament.get_packages_with_prefixes() == {"my_bot": str(my_bot)}


def test_where_it_is_installed_share_and_prefix_differ(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (home / "install/share/arm").mkdir(parents=True)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(home / "install"))
    packages.use({})
    assert ament.get_package_share_directory("arm") == str(home / "install/share/arm")
    assert ament.get_package_prefix("arm") == str(home / "install")


def test_what_package_gives_comes_first(my_bot: Path, home: Path) -> None:
    packages.use({"my_bot": home})
    assert ament.get_package_share_path("my_bot") == home


def test_a_repository_without_a_package_name_serves_for_any(home: Path, write: Write) -> None:
    write("urdf/hb_bot.urdf.xacro")
    packages.use({})
    assert ament.get_package_share_path("holo") == home


def test_a_wrong_name_does_not_match_a_repository_without_one(my_bot: Path, write: Write) -> None:
    write("urdf/hb_bot.urdf.xacro")
    packages.use({})
    with pytest.raises(ament.PackageNotFoundError, match="did you mean 'my_bot'"):
        ament.get_package_share_path("my_bto")
    assert ament.get_package_share_path("holo") != my_bot


def test_an_unknown_package_is_an_error_with_the_fix(my_bot: Path, write: Write) -> None:
    write("src/my_bot/urdf/a.urdf")
    packages.use({}, my_bot)
    with pytest.raises(ament.PackageNotFoundError) as error:
        ament.get_package_share_directory("my_bott")
    assert isinstance(error.value, KeyError)
    message = str(error.value)
    assert message.startswith(f"no package 'my_bott' around {my_bot}, ")
    assert "did you mean 'my_bot'?" in message
    assert message.endswith("to give its folder: --package my_bott=DIR")


def test_what_is_no_name_is_refused(my_bot: Path) -> None:
    for wrong in ["", None, 7]:
        with pytest.raises(ValueError, match="is not a package name"):
            ament.get_package_share_directory(wrong)  # type: ignore[arg-type]


def test_the_folder_of_a_stand_in_is_only_a_name(my_bot: Path) -> None:
    packages.stand_ins["gazebo_ros"] = Path("/stands-in/gazebo_ros")
    assert ament.get_package_share_directory("gazebo_ros") == "/stands-in/gazebo_ros"
