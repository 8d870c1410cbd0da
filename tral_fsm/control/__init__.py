"""The laws that steer and drive: plain functions of plain numbers."""
