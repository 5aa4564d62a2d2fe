"""Files of measurements as tables of numbers: text of any layout, MATLAB, HDF5, netCDF, NumPy."""
