"""The flight in the sample logs: rates as least squares find them, attitude by rotation matrices."""

from beaver_ftc_logs import sample_logs


def test_two_flights_in_a_table_and_the_left_elevon_of_the_second_is_weak_from_90_s(monkeypatch):
    text = sample_logs._table_text(0.1, 1, lambda t_s: 1.0)
    header, *rows, end = text.split("\n")
    assert header == "time_ms,gyro_x,gyro_y,gyro_z,roll_cmd,pitch_cmd,roll_rad,pitch_rad"
    assert ([row.split(",")[0] for row in rows], end) == (["0", "50"], "")
    assert all(len(cell.lstrip("-0.").replace(".", "")) <= 7 for row in rows for cell in row.split(","))
    monkeypatch.setattr(
        sample_logs,
        "_table_text",
        lambda duration_s, seed, left_effectiveness: (duration_s, *map(left_effectiveness, (89.9, 90.0))),
    )
    found = sample_logs.files()
    assert found["healthy.csv"] == (600.0, 1.0, 1.0)
    assert found["suspect.csv"] == (180.0, 1.0, 0.4)
