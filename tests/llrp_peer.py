"""Reads LLRP messages from a file with pyllrp, a decoder that is not ours, and prints each tag report as a line of JSON."""

import json
import sys

import bitstring
from pyllrp import pyllrp

FIELDS = {
    "antenna": (pyllrp.AntennaID_Parameter, "AntennaID"),
    "channel": (pyllrp.ChannelIndex_Parameter, "ChannelIndex"),
    "rospec": (pyllrp.ROSpecID_Parameter, "ROSpecID"),
    "peak_rssi_dbm": (pyllrp.PeakRSSI_Parameter, "PeakRSSI"),
    "first_seen_us": (pyllrp.FirstSeenTimestampUTC_Parameter, "Microseconds"),
    "last_seen_us": (pyllrp.LastSeenTimestampUTC_Parameter, "Microseconds"),
    "count": (pyllrp.TagSeenCount_Parameter, "TagCount"),
    "phase": (pyllrp.ImpinjRFPhaseAngle_Parameter, "PhaseAngle"),
    "peak_rssi": (pyllrp.ImpinjPeakRSSI_Parameter, "RSSI"),
    "doppler": (pyllrp.ImpinjRFDopplerFrequency_Parameter, "DopplerFrequency"),
}


def report(parameters):
    """One tag report as a dictionary."""
    found = {type(p): p for p in parameters}
    assert len(found) == len(parameters), "a parameter twice"
    line = {}
    if pyllrp.EPC_96_Parameter in found:
        line["epc"] = f"{found.pop(pyllrp.EPC_96_Parameter).EPC:024x}"
    else:
        line["epc"] = found.pop(pyllrp.EPCData_Parameter).EPC.hex()
    for name, (kind, field) in FIELDS.items():
        line[name] = getattr(found.pop(kind), field)
    line["others"] = [kind.__name__ for kind in found]
    return line


def main():
    """The file that the first argument names."""
    with open(sys.argv[1], "rb") as file:
        rest = file.read()
    while rest:
        length = int.from_bytes(rest[2:6], "big")
        message = pyllrp.UnpackMessage(bitstring.ConstBitStream(bytes=rest[:length]))
        assert isinstance(message, pyllrp.RO_ACCESS_REPORT_Message), message
        for tag in message.Parameters:
            print(json.dumps(report(tag.Parameters)))
        rest = rest[length:]


if __name__ == "__main__":
    main()
