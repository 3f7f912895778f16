"""Recordings of other ROS nodes on the command line: their own folder, as any file of channels."""

from files.formats.test_bags import BEGIN, STEP, VALUES, Bag, make_accel, make_wrench, send

from impact_rig.recordings.run import Run


def write_bag(tmp_path):
    path = Bag(tmp_path / "bag").write(
        tip=send(make_wrench, VALUES), body=send(make_accel, -0.5 * VALUES)
    )
    return path.parent


def test_the_force_is_the_hammers_and_the_acceleration_the_samples(run, tmp_path):
    outcome = run("analyze", write_bag(tmp_path))
    assert "Channels: hammer '/tip.wrench.force.z' [N], sample '/body.accel.linear.z' [m/s^2]" in (
        " ".join(outcome.stdout.split())
    )


def test_an_imported_bag_is_a_recording_of_its_hit(run, tmp_path):
    output = tmp_path / "hits.mcap"
    masses = ["--hammer-mass", "100g", "--sample-mass", "60g"]
    outcome = run("import", write_bag(tmp_path), "-o", output, *masses)
    assert outcome.exit_code == 0, outcome.stderr
    _, block = Run(output).events()
    assert block.stamp == BEGIN
    assert block.hammer.output.tolist() == VALUES.tolist()
    assert block.specimen.output.tolist() == (-0.5 * VALUES).tolist()
    assert block.sampling_rate == 1e9 / STEP


def test_a_template_lists_what_there_is(run, tmp_path):
    outcome = run("import", "--template", write_bag(tmp_path))
    assert "'/tip.wrench.force.z' (200 points in N)" in outcome.stdout
    assert 'channel = "/body.accel.linear.z"' in outcome.stdout
