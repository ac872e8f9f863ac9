"""Files of lasers, precise orbits, astrometry, space surveillance, and tables: good ones, small, for `tracked.Tracked`."""

from tests.fuzz.tracked import Tracked

CRD = """H1 CRD  2 2021 01 27 09
H2 GRZL 7839 34 02  4 EUROLAS
H3 lageos1    7603901  1155 8820     0 1 1
H4  {kind} 2021 01 26 23 55 51 2021 01 27 00 34 18  {release} 0 0 0 {delay} 0 {ranges} 0
H5  1 22 060500 SGF 15701
C0 0 532.000 0902 2kHz C_SPAD1 GPS
C1 0 2kHz Nd:Van 1064 2000 0.400 10 10 1
C4 0 mc1 0.000 0.00 123.789 0.00 0.000000000000 0 0 0
00 remark
60 0902 0 0
20 86151.000  956.42 273.00 67.1 1
20  2058.000  956.51 na 68.1 1
21 2716.000 3.1 45 none 20 na 3 10 290.45
40 86100.0 0 0902 10000  8390   1.742   111916.9 2.9 17.0 0.010 -0.651 -1.0 2 2 0
{rows}
12 86181.27 0902 0.0 0.0000 0.00 0.0000 0.0000
30 86181.27 215.0 15.000010 0 2 0 na na
50 0902   34.0   0.258  -0.949  -18.6 1
91 user
H8
"""
FULL = (
    "10 86181.271863631440 0.058145452724 0902 2 2 0 0 -1 -1\n10 86181.28 0.0581 0902 2 1 0 0 -1\n10 3.2 0.0455 0902 2 0 0 0 -1"
)
POINTS = (
    "11 86181.271863631440 0.058145452724 0902 2 120.0 9 35.1 0.1 -1.0 -9.9 0.1 0\n11 3.2 0.0455 0902 2 120.0 1 35.1 1 1 1 1 0"
)
SP3 = """#dV2015  5  5  0  0  0.00000000       2   u+U IGS08 FIT  GFZ
## 1843 172800.00000000   300.00000000 57147 0.0000000000000
+    2   G01E05  0  0  0  0  0  0  0  0  0  0  0  0  0  0  0
++         6  0  0  0  0  0  0  0  0  0  0  0  0  0  0  0  0
%c M  cc {scale} ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc
%f  1.2500000  1.025000000  0.00000000000  0.000000000000000
%i    0    0    0    0      0      0      0      0         0
/* remark
*  2015  5  5  0  0  0.00000000
PG01  13368.836676 -12067.323612  19408.991069     -5.982540
VG01  32349.234000 -61096.609000  29639.195000     20.000000
PE05      0.000000      0.000000      0.000000 999999.999999
*  2015  5  5  0  5  0.50000000
PG01  13427.144673 -11316.304150  19821.250975 999999.999999 18 20 22 219 EP  MP
EP  55  56  57     222  1234567 -1234567  5999999        1       -1       -1
PE05 -20525.786428  -1287.865100 -16954.601662   -245.585085  7  8  9
EOF
"""
CPF = """H1 CPF  2  HTS 2016 12 31 12 366 1 lageos1 NONE
H2  7603901 1155     8820 2016 12 31  0  0  0 2017  1  2  0  0  0   300 1 1  0 0 0 1
H5 0.2510
H9
10 0 57753  86399.500000  0    2966379.904    4195129.466  -11136763.061
20 0 1.0 -2.0 3.5
10 0 57754  0.250000  1    2966379.904    4195129.466  -11136763.061
30 0 0.0 0.0 0.0 0.0
99
"""
MPC = [
    "00433".ljust(14) + "C2012 01 26.170220" + "12 43 22.43 " + "-10 51 17.1".ljust(21) + " 14.2Vu" + "MPE01" + "703",
    "00001".ljust(14) + "A1901 01 26.17" + "    12 43 22.43 " + "+10 51".ljust(21) + "       " + "MPE01" + "535",
    "     T1S1222  S1995 10 19.53839 23 45 35.737+09 09 38.13".ljust(77) + "250",
    "     T1S1222  s1995 10 19.53839 1 + 5530.3041 - 4255.1515 -  550.2319".ljust(77) + "250",
    "    CJ95O010  V2012 01 26.170220" + "12 43 22.43 " + "-10 51 17.1".ljust(33) + "247",
    "    CJ95O010  v2012 01 26.170220" + "1 249.265700 +31.688000  2510".ljust(45) + "247",
    "     J95X00A  R1975 01 22.291667" + "   150884200000" + "+     123456789" + " 23885" + "251".ljust(9) + "253",
    "     J95X00A  r1975 01 22.291667" + "C" + "25000".rjust(14) + "50000".rjust(15) + "5     " + "251".ljust(9) + "253",
    "     _QC0000  X2026 01 26.170220" + "12 43 22.43 " + "-10 51 17.1".ljust(33) + "703",
]
PSV = """# version=2017
# observatory
! mpcCode F51
permID |provID  |stn |obsTime                 |ra        |dec       |rmsRA|rmsDec|rmsCorr|rmsTime|astCat|mag  |band
433    |        |F51 |2016-08-29T12:23:34.123Z|215.10254 |-12.547281|0.09 |0.08  |-0.214 |0.5    |Gaia1 |21.91|r
       |2016 PQ |F51 |2016-08-29T12:23:35Z    |0.5       |12.5      |     |      |       |       |Gaia1 |     |
"""
ADES = """<?xml version="1.0"?>
<ades version="2017"><obsBlock><obsContext><observatory><mpcCode>F51</mpcCode></observatory></obsContext><obsData>
<optical><permID>433</permID><stn>F51</stn><obsTime>2016-08-29T12:23:34.123Z</obsTime><ra>215.1</ra><dec>-12.5</dec>
<sys>WGS84</sys><ctr>399</ctr><pos1>10</pos1><pos2>-20.5</pos2><pos3>3</pos3><rmsRA>0.09</rmsRA></optical>
<optical><provID>2016 PQ</provID><stn>244</stn><obsTime>2016-08-29T12:23:34Z</obsTime><raStar>100</raStar>
<decStar>60</decStar><deltaRA>1.0</deltaRA><deltaDec>-2.0</deltaDec></optical>
<radar><permID>433</permID><obsTime>2016-08-29T12:23:34Z</obsTime><trx>251</trx><rcv>253</rcv><delay>15.1</delay>
<rmsDelay>2.5</rmsDelay><doppler>-1e4</doppler><rmsDoppler>0.5</rmsDoppler><frq>2380</frq><com>1</com></radar>
</obsData></obsBlock></ades>
"""
B3 = [
    "U0773493295029023837000161932 0604991 20475022                            2     00000",
    "U0773493295029023849000172761 0621435 01984671                            2     00000",
    "U077349329502902390200018551J 1230566 19184892" + " 0123456".ljust(28) + "3",
    "U0773493295029023914000197261 1230566".ljust(74) + "5",
    "U0773493295029023926000209351 1230566".ljust(46) + "00123456700234567R03456789}".ljust(28) + "9",
]
IOD = [
    "12345 98 123XYZ 2007 S 19981122112233444 56 14 1122334-112233 46 B+MMm Mm SSSsss",
    "12345 98 123A   2007 P 200811221122334   27 65 1112233+112    27 S+070 10",
    "12345 98 123UNK 2007 F 20081122112233444 28                      V+095 05",
]
UK = "8406503987697070622352907  01   12200054  +28239  01  4             +60+70     R\n"
LETTER = "\n".join(["SATOBS", "# clock by radio", *IOD, "12345 98 123A   2007 E 20081122112233444 F flared", "regards"]) + "\n"
RADIO = "# S band\n58130.50000000 2244012345.5 12.3 4171\n18/01/12 12:00:10.5 2244012245.0 1.1e-3 4553\n"
RDE = "2420 0405 0.211 1204\n05\n0401203 205744.76 185544+324606 4.0 5.8 3 R\n06\n0401203 000000.5 000000-000010\n999\n"
PLAIN = """# remark
 2    7734     932 1995  1 29 02 38 37.000      2047.50200   60.4991    16.1932
 3    7734     932 1995  1 29 02 38 49.000      62.1435    17.2761
"""


class Laser(Tracked):
    """Laser ranges and predictions for those who range."""

    ending = "tdm"

    def texts(self) -> list[str]:
        points = CRD.format(kind=1, release=0, delay=1, ranges=2, rows=POINTS)
        later = CRD.format(kind=1, release=1, delay=0, ranges=4, rows=POINTS.replace("0902 2 120", "0902 5 120"))
        return [points + later + "H9\n", CRD.format(kind=0, release=0, delay=1, ranges=2, rows=FULL) + "H9\n", CPF]


class Sp3(Tracked):
    """Precise orbits."""

    ending = "oem"

    def texts(self) -> list[str]:
        return [SP3.format(scale=scale) for scale in ("GPS", "UTC")]


class Astrometry(Tracked):
    """Right ascension and declination of minor planets, radar, and of satellites by those who see them."""

    ending = "tdm"

    def texts(self) -> list[str]:
        return [
            "\n".join(MPC[1:]) + "\n",
            "\n".join(MPC[:1]) + "\n",
            PSV,
            ADES,
            LETTER,
            UK * 2 + "999\n",
            "SATOBS\n" + RDE,
            RADIO,
        ]


class Surveillance(Tracked):
    """Radars of space surveillance."""

    ending = "tdm"

    def texts(self) -> list[str]:
        return ["\n".join(B3) + "\n", "\n".join(B3[:2] * 3) + "\n", PLAIN]


TABLE = """# frame = ITRF
week;sow;x [km];y [m];z;mode
1843;172800.25;13368.836676;-12067.323612;19408.991069;3D
1843;173100;13427.144673;-11316.304150;19821.250975;3D
"""
DATED = """# range = two-way
time[UTC],station,object,range [km],azimuth [deg],elevation [deg],sigma range [m],pressure [Pa]
2024-05-05T12:00:00.5,BER,SAT,1000.25,90,45,7,95000
2024-05-05T12:00:10.25,BER,SAT,1010.25,91,46,7,
2024-05-05T12:00:05,ROM,SAT,,92,47,,
"""
PLACES = (
    "# epoch = 2024-05-05T12:00:00 UTC\ntime\tlatitude[deg]\tlongitude[deg]\theight[km]\n0\t48\t11\t500\n10.5\t49\t12\t501\n"
)


class Table(Tracked):
    """Tables of measurements."""

    ending = "csv"

    def texts(self) -> list[str]:
        plain = "time,x[km],y[km],z[km],vx[m/s],vy[m/s],vz[m/s]\n2024-05-05T12:00:00Z,1,2,3,4,5,6\n"
        days = "time[MJD UTC];x[km];y[km];z[km]\n58130.5;1;2;3\n58130.625;1;2;3\n"
        return [DATED, PLACES, plain, TABLE, days, days.replace("MJD UTC", "unix")]
