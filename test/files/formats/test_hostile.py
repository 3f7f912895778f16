"""Whatever a file holds, it is read or refused in a sentence; `bench fuzz` tries thousands."""

import pytest
from bench.damage import mutate, write_files
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from impact_rig.core.given.errors import RigError
from impact_rig.files.formats.registry import FORMATS, read_measurement


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("good")
    write_files(folder)
    return {path.suffix: path.read_bytes() for path in folder.iterdir() if path.suffix in FORMATS}


@given(seed=st.integers(0, 2**32), noise=st.binary(max_size=200), place=st.integers(0, 10**4))
@settings(
    max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_spoilt_files_of_all_formats_are_read_or_refused_in_a_sentence(
    originals, tmp_path, seed, noise, place
):
    for suffix, data in originals.items():
        path = tmp_path / f"spoilt{suffix}"
        spoilt = mutate(data, seed)
        at = place % (len(spoilt) + 1)
        path.write_bytes(spoilt[:at] + noise + spoilt[at:])
        try:
            read_measurement(path)
        except RigError as error:
            assert "spoilt" in str(error) or "there is no file" in str(error)  # noqa: PT017
            assert "\n" not in str(error)  # noqa: PT017
