"""The text of a LabVIEW measurement file with one FRF, as National Instruments specifies it."""

from __future__ import annotations

HEADER = """\
LabVIEW Measurement
Writer_Version\t2
Reader_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tYes
X_Columns\tOne
Time_Pref\tAbsolute
Operator\tN. N.
Date\t2026/03/25
Time\t09:51:39.1970510124996275989
***End_of_Header***\t

"""
SEGMENT = """\
Channels\t2\t\t
Samples\t3\t3\t
Date\t2026/03/25\t2026/03/25\t
Time\t09:51:40.7\t09:51:40.7\t
X_Dimension\tFrequency\tFrequency\t
X_Unit_Label\tHz\tHz\t
X0\t10.0\t10.0\t
Delta_X\t2.5\t2.5\t
Y_Unit_Label\tm/s^2/N\tm/s^2/N\t
***End_of_Header***\t\t\t
X_Value\tFRF (Real)\tFRF (Imag)\tComment
10.0\t1.5\t-2.0\tfirst
12.5\t3.0\t0.25
15.0\t0.0\t-4.125
"""
