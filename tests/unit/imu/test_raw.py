"""Our own frame: the documented C sender's bytes, COBS, CRC."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foottrack_service.imu.formats import cobs
from foottrack_service.imu.formats.raw import BODY, CRC, RawDecoder, crc16, encode
from foottrack_service.imu.sample import DeviceSample

DOCUMENT = Path(__file__).parents[3] / "protocol" / "RAW_IMU.md"

MAIN = """
#include <stdio.h>
#ifdef _WIN32
#include <fcntl.h>
#include <io.h>
#endif
static void put(uint8_t byte) { putchar(byte); }
int main(void) {
#ifdef _WIN32
    _setmode(_fileno(stdout), _O_BINARY);
#endif
    for (int k = 0; k < 600; k++) {
        const float acc[3] = {0.0f, (float)k * 0.25f, -9.5f}, gyro[3] = {0.0f, 0.0f, (float)k * -0.125f};
        send_imu(4294960000u + 2500u * (uint32_t)k, acc, gyro, put);
    }
    return 0;
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_documented_c_sender_is_decoded(tmp_path: Path) -> None:
    code = re.findall(r"```c\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    assert len(code) == 1
    source, program = tmp_path / "sender.c", tmp_path / "sender"
    source.write_text(code[0] + MAIN)
    warnings = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic"]
    subprocess.run(["cc", *warnings, "-o", program, source], check=True)
    sent = subprocess.run([program], check=True, capture_output=True).stdout
    decoder = RawDecoder()
    samples = decoder.feed(sent)
    assert not any(decoder.drops.values())
    assert samples == [
        DeviceSample((4294960000 + 2500 * k) % 2**32, (0.0, k * 0.25, -9.5), (0.0, 0.0, k * -0.125)) for k in range(600)
    ]
    assert sent == b"".join(encode(sample, k) for k, sample in enumerate(samples))


@given(st.binary(max_size=700))
def test_cobs_there_and_back(data: bytes) -> None:
    frame = cobs.encode(data)
    assert 0 not in frame
    assert len(frame) <= len(data) + 1 + len(data) // 254
    assert cobs.decode(frame) == data


@pytest.mark.parametrize(
    ("plain", "encoded"),
    [
        # Of the table in Wikipedia's article.
        ("00", "0101"),
        ("0000", "010101"),
        ("11220033", "0311220233"),
        ("11000000", "0211010101"),
    ],
)
def test_cobs_by_hand(plain: str, encoded: str) -> None:
    assert cobs.encode(bytes.fromhex(plain)).hex() == encoded
    assert cobs.decode(bytes.fromhex(encoded)) == bytes.fromhex(plain)


def test_cobs_refuses_what_points_beyond_its_end() -> None:
    assert cobs.decode(b"\x05\x01") is None


def test_the_checksum_is_ccitt_false() -> None:
    assert crc16(b"123456789") == 0x29B1


def test_missing_sequence_numbers_are_counted() -> None:
    decoder = RawDecoder()
    sample = DeviceSample(1, (0.0, 0.0, 9.8), (0.0, 0.0, 0.0))
    for sequence in (254, 255, 2):
        assert len(decoder.feed(encode(sample, sequence))) == 1
    assert decoder.drops["lost"] == 2
    for sequence in (100, 0, 1):
        decoder.feed(encode(sample, sequence))
    # 97 between 2 and 100; the way back to 0 is a device that started anew.
    assert decoder.drops["lost"] == 2 + 97


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (BODY.pack(2, 0, 0, 0, 0, 9.8, 0, 0, 0), "version"),
        (BODY.pack(1, 0, 0, 0, 0, float("nan"), 0, 0, 0), "range"),
        (BODY.pack(1, 0, 0, 0, 0, 9.8, float("inf"), 0, 0), "range"),
        (BODY.pack(1, 0, 0, 0, 0, 4001.0, 0, 0, 0), "range"),
        (BODY.pack(1, 0, 0, 0, 0, 9.8, 0, 0, 0)[:-4], "length"),
    ],
)
def test_what_cannot_be_is_counted_by_reason(body: bytes, reason: str) -> None:
    decoder = RawDecoder()
    assert decoder.feed(cobs.encode(body + CRC.pack(crc16(body))) + b"\0") == []
    assert decoder.drops == {reason: 1}


def test_a_wrong_checksum_and_a_torn_frame() -> None:
    decoder = RawDecoder()
    frame = bytearray(encode(DeviceSample(1, (1.0, 2.0, 9.8), (0.1, 0.2, 0.3)), 0))
    frame[-4] ^= 0x10
    assert decoder.feed(bytes(frame) + b"\x09\x01\0") == []
    assert decoder.drops == {"crc": 1, "framing": 1}
    with pytest.raises(ValueError, match="gyro"):
        encode(DeviceSample(1, (0.0, 0.0, 9.8)), 0)
    assert struct.calcsize("<BBI6f") == BODY.size == 30
