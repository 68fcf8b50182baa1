"""Every file that camcal reads or writes."""
