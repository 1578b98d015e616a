// Linear statics of linear tetrahedra under loads, as an external simulator without any library.
//
// g++ -O2 -std=c++17 -o my_simulator example_simulator.cpp && validate external check ./my_simulator
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <numeric>
#include <sstream>
#include <string>
#include <vector>
using namespace std;
using V = vector<double>;

string text(const string& path) {
    ifstream file(path);
    return string(istreambuf_iterator<char>(file), {});
}

string behind(const string& s, const string& key) {  // what follows a key; empty: there is none
    size_t at = s.find(key);
    return at == string::npos ? "" : s.substr(at + key.size());
}

V numbers(const string& s, char open, char close) {  // of a list, in whatever brackets it has
    string flat;
    int depth = 0;
    for (char c : s.substr(min(s.find(open), s.size()))) {
        depth += (c == open) - (c == close);
        if (depth == 0) break;
        flat += strchr("[],<>", c) ? ' ' : c;
    }
    stringstream in(flat);
    return V(istream_iterator<double>(in), {});
}

uint32_t crc(const string& s) {
    uint32_t c = ~0u;
    for (unsigned char byte : s) {
        c ^= byte;
        for (int k = 0; k < 8; k++) c = c & 1 ? 0xEDB88320u ^ c >> 1 : c >> 1;
    }
    return ~c;
}

template <class T> string raw(T x) { return string(reinterpret_cast<char*>(&x), sizeof x); }

void npz(const string& path, const map<string, pair<string, V>>& arrays) {  // zip, nothing packed
    string body, list;
    for (auto& [name, array] : arrays) {
        string head = "{'descr': '<f8', 'fortran_order': False, 'shape': (" + array.first + "), }";
        head += string(117 - head.size(), ' ') + "\n";
        string data = string("\x93NUMPY\x01\0", 8) + raw(uint16_t(head.size())) + head;
        data.append(reinterpret_cast<const char*>(array.second.data()), 8 * array.second.size());
        string file = name + ".npy", sizes = raw(crc(data)) + raw(uint32_t(data.size())) +
            raw(uint32_t(data.size())) + raw(uint16_t(file.size())) + raw(uint16_t(0));
        string about = raw(uint16_t(20)) + string(8, '\0') + sizes;
        list += "PK\1\2" + raw(uint16_t(20)) + about + string(10, '\0') +
            raw(uint32_t(body.size())) + file;
        body += "PK\3\4" + about + file + data;
    }
    auto n = raw(uint16_t(arrays.size()));
    ofstream(path, ios::binary) << body << list << "PK\5\6" << string(4, '\0') << n << n
        << raw(uint32_t(list.size())) << raw(uint32_t(body.size())) << string(2, '\0');
}

struct Tet { array<size_t, 4> node; double volume, grad[4][3]; };

Tet tet(const V& x, const double* corners) {  // gradients of its four shape functions
    Tet e;
    double a[3][3];
    for (int k = 0; k < 4; k++) e.node[k] = size_t(corners[k]);
    for (int k = 0; k < 3; k++)
        for (int c = 0; c < 3; c++) a[k][c] = x[3 * e.node[k + 1] + c] - x[3 * e.node[0] + c];
    auto minor = [&](int k, int c) {
        int p = (k + 1) % 3, q = (k + 2) % 3, r = (c + 1) % 3, s = (c + 2) % 3;
        return a[p][r] * a[q][s] - a[p][s] * a[q][r];
    };
    double six = a[0][0] * minor(0, 0) + a[0][1] * minor(0, 1) + a[0][2] * minor(0, 2);
    e.volume = six / 6;
    for (int c = 0; c < 3; c++) {
        e.grad[0][c] = 0;
        for (int k = 0; k < 3; k++) e.grad[0][c] -= e.grad[k + 1][c] = minor(k, c) / six;
    }
    return e;
}

V pulled(const vector<Tet>& body, const V& u, double mu, double lambda) {  // K u
    V f(u.size(), 0.0);
    for (auto& e : body) {
        double H[3][3] = {};
        for (int k = 0; k < 4; k++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) H[i][j] += u[3 * e.node[k] + i] * e.grad[k][j];
        double trace = lambda * (H[0][0] + H[1][1] + H[2][2]);
        for (int k = 0; k < 4; k++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++)
                    f[3 * e.node[k] + i] += e.volume * e.grad[k][j] *
                        (mu * (H[i][j] + H[j][i]) + (i == j ? trace : 0));
    }
    return f;
}

double dot(const V& a, const V& b) { return inner_product(a.begin(), a.end(), b.begin(), 0.0); }

int main(int, char** argv) {
    string folder = string(argv[1]) + "/", job = text(folder + "job.json");
    string mesh = text(folder + "mesh.vtu"), material = behind(job, "\"material\": ");
    material = material.substr(0, material.find('}') + 1);
    ofstream answer(folder + "answer.json");
    answer << R"({"schema": "validate-external-answer/1", "name": "example in C++", "version": "1")"
           << R"(, "mesh_sha256": ")" << behind(job, "\"sha256\": \"").substr(0, 64) << '"';
    for (string has : {"\"tet4\"", "\"law\": \"linear\"", "\"inertia\": false", "\"drives\": []",
                       "\"weights\": []"})
        if (job.find(has) == string::npos) {
            answer << R"(, "state": "cannot_run", "reason": "not written: all but )"
                   << "linear statics of linear tetrahedra under loads\"}";
            return 0;
        }
    double E = stod(behind(material, "\"E\": ")), nu = stod(behind(material, "\"nu\": "));
    double mu = E / 2 / (1 + nu), lambda = 2 * mu * nu / (1 - 2 * nu);
    V x = numbers(behind(mesh, "\"Points\""), '>', '<');
    V corners = numbers(behind(mesh, "\"connectivity\""), '>', '<');
    vector<Tet> body;
    for (size_t e = 0; e < corners.size(); e += 4) body.push_back(tet(x, &corners[e]));
    V free(x.size(), 1.0), times = numbers(behind(job, "\"times\": "), '[', ']');
    string still = behind(job, "\"held\": ");
    V node = numbers(behind(still, "\"nodes\": "), '[', ']');
    V component = numbers(behind(still, "\"components\": "), '[', ']');
    for (size_t k = 0; k < node.size(); k++) free[size_t(3 * node[k] + component[k])] = 0;
    size_t skip = numbers(behind(job, "\"instants\": "), '[', ']').size() - times.size();
    V u(x.size(), 0.0), fields, reactions;
    for (size_t i = 0; i < times.size(); i++) {
        V f(x.size(), 0.0);
        string loads = behind(job, "\"loads\": ");
        loads = loads.substr(0, loads.find("\"weights\""));
        for (; loads.find("\"history\"") != string::npos; loads = behind(loads, "\"forces\"")) {
            V y = numbers(behind(loads, "\"history\""), '[', ']');
            V at = numbers(behind(loads, "\"nodes\""), '[', ']');
            V each = numbers(behind(loads, "\"forces\""), '[', ']');
            for (size_t k = 0; k < each.size(); k++)
                f[size_t(3 * at[k / 3]) + k % 3] += each[k] * y[skip + i];
        }
        V r = f, Ku = pulled(body, u, mu, lambda);  // conjugate gradients, on what is free
        for (size_t k = 0; k < r.size(); k++) r[k] = free[k] * (r[k] - Ku[k]);
        V p = r;
        for (double rr = dot(r, r), end = 1e-24 * dot(f, f), before; rr > end;) {
            V Kp = pulled(body, p, mu, lambda);
            double step = rr / dot(p, Kp);
            for (size_t k = 0; k < r.size(); k++)
                u[k] += step * p[k], r[k] -= step * free[k] * Kp[k];
            before = rr, rr = dot(r, r);
            for (size_t k = 0; k < r.size(); k++) p[k] = r[k] + rr / before * p[k];
        }
        Ku = pulled(body, u, mu, lambda);
        for (size_t k = 0; k < u.size(); k++) Ku[k] = (1 - free[k]) * (Ku[k] - f[k]);
        fields.insert(fields.end(), u.begin(), u.end());
        reactions.insert(reactions.end(), Ku.begin(), Ku.end());
    }
    string k = to_string(times.size()), shape = k + ", " + to_string(x.size() / 3) + ", 3";
    npz(folder + "fields.npz", {{"t", {k + ",", times}}, {"u", {shape, fields}},
                                {"reactions", {shape, reactions}}});
    answer << ", \"state\": \"finished\", \"used\": " << material << "}";
}
