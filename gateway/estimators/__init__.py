"""Estimators: functions from state to state over leading axes, which also return what the measurement told."""
