"""BNO08x over SHTP: layouts by hand, the host's conversation with the device, loss and order of reports."""

from __future__ import annotations

import struct

import pytest
from imu_streams import motion

from foottrack_service.imu.devices.bno08x import Bno08xDevice
from foottrack_service.imu.formats import sh2
from foottrack_service.imu.formats.bno08x import REPLY_S, Bno08xDecoder
from foottrack_service.imu.formats.sh2 import Command, Report, SensorReport
from foottrack_service.imu.formats.shtp import Channel, ShtpSender
from foottrack_service.imu.sample import DeviceSample


def talk(decoder: Bno08xDecoder, device: Bno08xDevice, now_s: float) -> None:
    """Until neither has anything to say."""
    while frames := decoder.to_send(now_s):
        for frame in frames:
            decoder.feed(device.hear(frame))


def configured(interval_us: int = 2500) -> tuple[Bno08xDecoder, Bno08xDevice]:
    decoder, device = Bno08xDecoder(interval_us), Bno08xDevice()
    talk(decoder, device, 0.0)
    return decoder, device


def input_frame(sender: ShtpSender, *reports: SensorReport) -> bytes:
    return sender.frame(Channel.INPUT, b"".join(sh2.input_report(report) for report in reports))


def test_set_feature_as_the_data_sheet_draws_it() -> None:
    # Its figure 5-1: the accelerometer each 60 ms, on channel 2, 21 bytes with the header.
    frame = ShtpSender().frame(Channel.CONTROL, sh2.set_feature(Report.ACCELEROMETER, 60_000))
    assert frame.hex() == "7e01" + "15000200" + "fd01000000" + "60ea0000" + "00000000" + "00000000" + "7e"


def test_an_input_cargo_as_the_data_sheet_draws_it() -> None:
    # Its figure 5-2: time base 1.7 ms, accelerometer with Q8 values 1, -2, 9.5 m/s^2 and status 3.
    payload = b"\xfb" + struct.pack("<i", 17) + bytes([0x01, 7, 3, 0]) + struct.pack("<3h", 256, -512, 2432)
    (report,) = sh2.input_reports(payload)
    assert report == SensorReport(Report.ACCELEROMETER, 7, 3, 1700, (1.0, -2.0, 9.5))


def test_the_delay_of_a_report_has_fourteen_bits_and_makes_it_younger() -> None:
    payload = b"\xfb" + struct.pack("<i", 600) + bytes([0x02, 0, 0x01 << 2 | 2, 44]) + struct.pack("<3h", 512, 0, -256)
    (report,) = sh2.input_reports(payload)
    assert report == SensorReport(Report.GYROSCOPE, 0, 2, (600 - 256 - 44) * 100, (1.0, 0.0, -0.5))


def test_reports_of_other_sensors_are_stepped_over() -> None:
    magnetometer = bytes([0x03]) + bytes(9)
    payload = magnetometer + bytes([0x01, 0, 0, 0]) + struct.pack("<3h", 0, 0, 2510)
    assert [report.kind for report in sh2.input_reports(payload)] == [Report.ACCELEROMETER]  # type: ignore[union-attr]


def test_the_host_resets_and_asks_for_each_report() -> None:
    decoder, device = Bno08xDecoder(10_000), Bno08xDevice()
    (reset,) = decoder.to_send(0.0)
    assert reset.hex() == "7e0105000100" + "01" + "7e"
    decoder.feed(device.hear(reset))
    features = decoder.to_send(0.001)
    assert len(features) == 3
    for frame in features:
        decoder.feed(device.hear(frame))
    assert device.intervals_us == dict.fromkeys(sh2.SENSORS, 10_000)
    assert decoder.clock.tick_us == 10_000.0
    assert decoder.to_send(100.0) == []


def test_what_is_not_answered_is_sent_again() -> None:
    decoder, device = Bno08xDecoder(), Bno08xDevice()
    assert len(decoder.to_send(0.0)) == 1
    assert decoder.to_send(REPLY_S * 0.9) == []
    (reset,) = decoder.to_send(REPLY_S)
    decoder.feed(device.hear(reset))
    acc, gyro, rotation = decoder.to_send(REPLY_S)
    decoder.feed(device.hear(acc))
    decoder.feed(device.hear(rotation))
    assert decoder.to_send(REPLY_S * 1.5) == []
    (again,) = decoder.to_send(REPLY_S * 2.0)
    # The same wish, with the channel's next sequence number.
    assert again[6:] == gyro[6:]


def test_the_rate_that_the_device_chose_is_the_clocks() -> None:
    decoder, device = configured(interval_us=1000)
    assert decoder.clock.tick_us == 2500.0
    (sample,) = decoder.feed(device.measure(motion(1, 2500)[0]))
    assert sample.ticks == 0


@pytest.mark.parametrize("interval_us", [0, 1, 2**31])
def test_a_report_that_was_turned_off_or_an_interval_that_cannot_be_is_asked_for_again(interval_us: int) -> None:
    decoder, device = configured()
    answer = sh2.feature_response(Report.ACCELEROMETER, interval_us)
    assert decoder.feed(ShtpSender().frame(Channel.CONTROL, answer)) == []
    assert decoder.clock.tick_us == 2500.0
    (again,) = decoder.to_send(100.0)
    device.intervals_us.clear()
    decoder.feed(device.hear(again))
    assert device.intervals_us == {Report.ACCELEROMETER: 2500}
    assert decoder.drops["interval"] == 1


def test_after_a_brown_out_it_is_configured_again() -> None:
    decoder, device = configured()
    samples = motion(4, 2500)
    (before,) = decoder.feed(device.measure(samples[0]))
    decoder.feed(device.start())
    assert device.measure(samples[1]) == b""
    talk(decoder, device, 10.0)
    (after,) = decoder.feed(device.measure(samples[2]))
    assert after.epoch > before.epoch
    assert after.ticks == 0
    assert not any(decoder.drops.values())


def test_save_and_clear_of_the_chips_calibration() -> None:
    decoder, device = configured()
    decoder.send_command(Command.SAVE_CALIBRATION)
    talk(decoder, device, 1.0)
    assert list(decoder.answers)[-1] == (Command.SAVE_CALIBRATION, 0)
    decoder.send_command(Command.CLEAR_CALIBRATION_AND_RESET)
    talk(decoder, device, 2.0)
    assert device.commands == [Command.SAVE_CALIBRATION, Command.CLEAR_CALIBRATION_AND_RESET]
    # It restarted, and talks again.
    assert device.intervals_us == dict.fromkeys(sh2.SENSORS, 2500)


@pytest.mark.parametrize("lost", sh2.SENSORS)
def test_a_lost_report_costs_its_own_cycle_only(lost: Report) -> None:
    decoder, _ = configured()
    sender = ShtpSender()
    samples: list[DeviceSample] = []
    for cycle in range(300):
        for kind in sh2.SENSORS:
            values = {
                Report.ACCELEROMETER: (cycle / 256.0, 0.0, 9.75),
                Report.GYROSCOPE: (cycle / 512.0, 0.0, 0.0),
                Report.GAME_ROTATION_VECTOR: (0.0, 0.0, 0.0, 1.0),
            }[kind]
            # Sensors were enabled one after the other: their counts differ.
            report = SensorReport(kind, cycle + int(kind) * 17, 3, 0, values)
            frame = input_frame(sender, report)
            if not (cycle == 100 and kind == lost):
                samples += decoder.feed(frame)
    cycles = [round(sample.acc[0] * 256) for sample in samples]
    assert cycles == [cycle for cycle in range(300) if cycle != 100]
    assert all(
        sample.gyro is not None and round(sample.gyro[0] * 512) == c for sample, c in zip(samples, cycles, strict=True)
    )
    assert decoder.drops["lost"] == 1
    assert decoder.drops["unpaired"] == 2


def test_a_damaged_sequence_number_costs_its_own_cycle_and_one_more() -> None:
    decoder, _ = configured()
    sender = ShtpSender()
    cycles = []
    for cycle in range(12):
        for kind in sh2.SENSORS:
            values = (0.0, 0.0, 0.0, 1.0) if kind == Report.GAME_ROTATION_VECTOR else (cycle / 256.0, 0.0, 9.75)
            damage = 4 if cycle == 5 and kind == Report.GYROSCOPE else 0
            frame = input_frame(sender, SensorReport(kind, cycle + damage, 3, 0, values))
            cycles += [round(sample.acc[0] * 256) for sample in decoder.feed(frame)]
    assert cycles == [0, 1, 2, 3, 4, 7, 8, 9, 10, 11]


def test_sequences_of_cargoes_that_go_back_are_no_loss() -> None:
    decoder, device = configured()
    sample = motion(1, 2500)[0]
    for _ in range(40):
        decoder.feed(device.measure(sample))
    # Its reset message was lost; what follows counts from 0 again.
    device.start()
    decoder.feed(device.hear(ShtpSender().frame(Channel.CONTROL, sh2.set_feature(Report.GYROSCOPE, 2500))))
    decoder.feed(device.measure(sample))
    assert decoder.drops["lost"] == 0


def test_kinds_that_run_at_different_rates_are_brought_in_step_again() -> None:
    decoder, _ = configured()
    sender = ShtpSender()
    samples = 0
    sequence = dict.fromkeys(sh2.SENSORS, 0)
    for tick in range(40_000):
        for kind, period in zip(sh2.SENSORS, (25, 26, 25), strict=True):
            if tick % period == 0:
                values = (0.0, 0.0, 0.0, 1.0) if kind == Report.GAME_ROTATION_VECTOR else (0.0, 0.0, 9.75)
                samples += len(decoder.feed(input_frame(sender, SensorReport(kind, sequence[kind], 3, 0, values))))
                sequence[kind] += 1
    # 1538 cycles of the slowest.
    assert samples > 1200


def test_damage_is_counted_by_reason() -> None:
    decoder, device = configured()
    sender = ShtpSender()
    rotation = SensorReport(Report.GAME_ROTATION_VECTOR, 0, 3, 0, (0.0, 0.0, 0.0, 0.8))
    others = [SensorReport(kind, 0, 3, 0, (0.0, 0.0, 9.75)) for kind in sh2.SENSORS[:2]]
    old = SensorReport(Report.GYROSCOPE, 1, 3, 5_000_000, (0.0, 0.0, 0.0))
    assert decoder.feed(input_frame(sender, *others, rotation, old)) == []
    cases = {
        "report_id": sender.frame(Channel.INPUT, b"\x99" + bytes(9)),
        "report_length": sender.frame(Channel.INPUT, b"\x01\x00\x00"),
        "protocol": b"\x7e\x05abc\x7e",
        "header": b"\x7e\x01ab\x7e",
        "channel": b"\x7e\x01" + struct.pack("<HBB", 4, 9, 0) + b"\x7e",
        "escape": b"\x7e\x01ab\x7d\x7e",
        "overlong": b"\x7e" + bytes([1]) * 3000 + b"\x7e",
        "fragment": b"\x7e\x01" + struct.pack("<HBB", 300, 0, 0) + bytes(100) + b"\x7e",
    }
    for stream in cases.values():
        assert decoder.feed(stream) == []
    assert {"quaternion", "age", *cases} <= set(decoder.drops)
    assert len(decoder.feed(device.measure(motion(1, 2500)[0]))) <= 1


def test_every_byte_that_must_be_escaped_is() -> None:
    payload = bytes(range(256))
    frame = ShtpSender().frame(Channel.CONTROL, payload)
    assert frame.count(b"\x7e") == 2
    assert frame[1:-1].count(b"\x7d") == 2
    decoder = Bno08xDecoder()
    assert decoder.feed(frame) == []
    assert not any(decoder.drops.values())
