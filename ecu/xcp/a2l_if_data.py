"""What an A2L file says of XCP: IF_DATA (ASAM MCD-1 XCP 1.5), and its grammar in A2ML as far as used."""

from collections.abc import Iterable
from typing import Final

from ecu.runtime.xcp import Transport
from ecu.xcp.calibration import SEGMENT, Page
from ecu.xcp.slave import CYCLE_MS, CYCLE_NAME, MOST_LISTS, OPTIONAL_COMMANDS, UNIT_1_MS, largest_entry
from ecu.xcp.transport import CAN, ETHERNET
from ecu.xcp.variables import RECORDS

VERSION: Final = "0x0105"

_COMMANDS = ",\n          ".join(f'"{one.name}" = 0x{one:02X}' for one in OPTIONAL_COMMANDS)
A2ML: Final = """/begin A2ML
block "IF_DATA" taggedunion if_data {
  "XCP" struct {
    taggedstruct {
      block "PROTOCOL_LAYER" struct {
        uint; uint; uint; uint; uint; uint; uint; uint; uchar; uint;
        enum { "BYTE_ORDER_MSB_LAST" = 0, "BYTE_ORDER_MSB_FIRST" = 1 };
        enum { "ADDRESS_GRANULARITY_BYTE" = 1 };
        taggedstruct { ("OPTIONAL_CMD" enum {
          COMMANDS
        })*; };
      };
      block "SEGMENT" struct {
        uchar; uchar; uchar; uchar; uchar;
        taggedstruct {
          (block "PAGE" struct {
            uchar;
            enum { "ECU_ACCESS_NOT_ALLOWED" = 0, "ECU_ACCESS_DONT_CARE" = 3 };
            enum { "XCP_READ_ACCESS_NOT_ALLOWED" = 0, "XCP_READ_ACCESS_DONT_CARE" = 3 };
            enum { "XCP_WRITE_ACCESS_NOT_ALLOWED" = 0, "XCP_WRITE_ACCESS_DONT_CARE" = 3 };
          })*;
        };
      };
      block "PAG" struct { uchar; };
      block "DAQ" struct {
        enum { "STATIC" = 0, "DYNAMIC" = 1 };
        uint; uint; uchar;
        enum { "OPTIMISATION_TYPE_DEFAULT" = 0 };
        enum { "ADDRESS_EXTENSION_FREE" = 0 };
        enum { "IDENTIFICATION_FIELD_TYPE_ABSOLUTE" = 0 };
        enum { "GRANULARITY_ODT_ENTRY_SIZE_DAQ_BYTE" = 1 };
        uchar;
        enum { "NO_OVERLOAD_INDICATION" = 0, "OVERLOAD_INDICATION_PID" = 1, "OVERLOAD_INDICATION_EVENT" = 2 };
        taggedstruct {
          "PRESCALER_SUPPORTED";
          block "TIMESTAMP_SUPPORTED" struct {
            uint;
            enum { "SIZE_BYTE" = 1, "SIZE_WORD" = 2, "SIZE_DWORD" = 4 };
            enum { "UNIT_1US" = 3 };
          };
          (block "EVENT" struct {
            char[101]; char[9]; uint;
            enum { "DAQ" = 1, "STIM" = 2, "DAQ_STIM" = 3 };
            uchar; uchar; uchar; uchar;
            taggedstruct { "CONSISTENCY" enum { "DAQ" = 0, "EVENT" = 1 }; };
          })*;
        };
      };
      (block "XCP_ON_UDP_IP" struct { uint; uint; taggedstruct { "ADDRESS" char[16]; }; })*;
      (block "XCP_ON_TCP_IP" struct { uint; uint; taggedstruct { "ADDRESS" char[16]; }; })*;
      (block "XCP_ON_CAN" struct { uint; taggedstruct { "CAN_ID_MASTER" ulong; "CAN_ID_SLAVE" ulong; }; })*;
    };
  };
};
/end A2ML""".replace("COMMANDS", _COMMANDS)

_PARAMETERS: Final = next(one for one in RECORDS if one.name == "parameters")
_READ: Final = "ECU_ACCESS_DONT_CARE XCP_READ_ACCESS_DONT_CARE XCP_WRITE_ACCESS"
MEMORY_SEGMENT: Final = f"""/begin MEMORY_SEGMENT parameters "" DATA RAM INTERN
0x{_PARAMETERS.base:X} 0x{_PARAMETERS.dtype.itemsize:X} -1 -1 -1 -1 -1
/begin IF_DATA XCP
/begin SEGMENT {SEGMENT} {len(Page)} 0 0 0
/begin PAGE {Page.REFERENCE} {_READ}_NOT_ALLOWED /end PAGE
/begin PAGE {Page.WORKING} {_READ}_DONT_CARE /end PAGE
/end SEGMENT
/end IF_DATA
/end MEMORY_SEGMENT"""


def if_data(transports: Iterable[Transport]) -> str:
    """Return the block of the module; the packets' sizes are those of the smallest transport."""
    chosen = list(transports)
    size = CAN if any(one.kind == "can" for one in chosen) else ETHERNET
    commands = "\n".join(f"OPTIONAL_CMD {one.name}" for one in OPTIONAL_COMMANDS)
    places = "\n".join(_place(one) for one in chosen)
    return f"""/begin IF_DATA XCP
/begin PROTOCOL_LAYER
{VERSION} 2000 2000 0 0 0 0 0 {size.command} {size.data} BYTE_ORDER_MSB_LAST ADDRESS_GRANULARITY_BYTE
{commands}
/end PROTOCOL_LAYER
/begin DAQ
DYNAMIC 0 1 0 OPTIMISATION_TYPE_DEFAULT ADDRESS_EXTENSION_FREE IDENTIFICATION_FIELD_TYPE_ABSOLUTE
GRANULARITY_ODT_ENTRY_SIZE_DAQ_BYTE {largest_entry(size)} OVERLOAD_INDICATION_EVENT
PRESCALER_SUPPORTED
/begin TIMESTAMP_SUPPORTED 1 SIZE_DWORD UNIT_1US /end TIMESTAMP_SUPPORTED
/begin EVENT "{CYCLE_NAME}" "{CYCLE_NAME}"
0 DAQ {MOST_LISTS} {CYCLE_MS} {UNIT_1_MS} 0 CONSISTENCY EVENT /end EVENT
/end DAQ
/begin PAG 1 /end PAG
{places}
/end IF_DATA"""


def _place(one: Transport) -> str:
    if one.kind == "can":
        identifiers = f"CAN_ID_MASTER {_identifier(one.request)} CAN_ID_SLAVE {_identifier(one.response)}"
        return f"/begin XCP_ON_CAN {VERSION} {identifiers} /end XCP_ON_CAN"
    block = f"XCP_ON_{one.kind.upper()}_IP"
    return f'/begin {block} {VERSION} {one.port} ADDRESS "{one.address}" /end {block}'


def _identifier(number: int) -> str:
    """Return an identifier, of 29 bits with the highest bit set."""
    return f"0x{number | (1 << 31 if number > 0x7FF else 0):X}"
