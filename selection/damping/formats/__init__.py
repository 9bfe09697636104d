"""Files of laboratories to records: UFF data set 58, MAT, HDF5, CSV with a column map, lock-in columns.

Bytes or a path in, a record and a summary of what was understood out. Every module is pure; none evaluates anything
or loads a pickle. The way is: ``reading.read_file`` turns any file into ``series.Series`` (one sweep or one time
history each, as the file has it, with what the file says of units and kind), ``steady.steady_record`` turns sweeps
into a record, ``conversion.time_histories`` turns time histories into displacement for ``signals.ringdown``. What
neither the file nor the user says is asked for in an error; nothing is guessed.
"""
