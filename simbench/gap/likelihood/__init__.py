"""How likely is PV, given OP (or MV)?"""
