// The speed floor: hand-written for the 2-D bearing-only orbit problem (4 states, scalar bearing).
// Written before Piazzi, to know what a machine can do, and adopted unchanged; floor.py builds and calls it.
#include <math.h>
#include <string.h>
#include <stdlib.h>
#include <stdint.h>
#include <time.h>
#include <pthread.h>
#if defined(__x86_64__)
#include <immintrin.h>
#endif
typedef double v4 __attribute__((vector_size(32)));
typedef long long i4 __attribute__((vector_size(32)));
typedef double v8 __attribute__((vector_size(64)));
typedef double v8u __attribute__((vector_size(64),aligned(8)));
#ifdef __AVX512F__
static inline v8 sqrt8(v8 x){ return (v8)_mm512_sqrt_pd((__m512d)x); }
#else
static inline v8 sqrt8(v8 x){ v8 o; for(int j=0;j<8;j++)o[j]=sqrt(x[j]); return o; }
#endif
#define GE 3.986e14
#define NS 15
static const double H1=1.0, H2=0.5;
static inline double wrap(double a){ if(a>M_PI)a-=2*M_PI; else if(a<-M_PI)a+=2*M_PI; return a;}
double now(void){struct timespec t;clock_gettime(CLOCK_THREAD_CPUTIME_ID,&t);return t.tv_sec+1e-9*t.tv_nsec;}
static double wall(void){struct timespec t;clock_gettime(CLOCK_MONOTONIC,&t);return t.tv_sec+1e-9*t.tv_nsec;}

static inline v4 prop(v4 s){
  double x=s[0],y=s[1],vx=s[2],vy=s[3];
  for(int n=0;n<NS;n++){
    double r2=x*x+y*y, i2=1.0/r2, r=sqrt(r2), k=r*(GE*(i2*i2));
    double nx=(x+H1*vx)-k*(H2*x), ny=(y+H1*vy)-k*(H2*y);
    vx-=k*(H1*x); vy-=k*(H1*y); x=nx; y=ny;
  }
  return (v4){x,y,vx,vy};
}
// rows of Phi as v4
static inline v4 propF(v4 s, v4 R[4]){
  double x=s[0],y=s[1],vx=s[2],vy=s[3];
  v4 R0={1,0,0,0},R1={0,1,0,0},R2={0,0,1,0},R3={0,0,0,1};
  for(int n=0;n<NS;n++){
    double r2=x*x+y*y, i2=1.0/r2, r=sqrt(r2), k=r*(GE*(i2*i2)), k5=3*k*i2;
    double gxx=k5*x*x-k, gxy=k5*x*y, gyy=k5*y*y-k;
    v4 A=gxx*R0+gxy*R1, B=gxy*R0+gyy*R1;
    R0+=H1*R2+H2*A; R1+=H1*R3+H2*B; R2+=H1*A; R3+=H1*B;
    double nx=(x+H1*vx)-k*(H2*x), ny=(y+H1*vy)-k*(H2*y);
    vx-=k*(H1*x); vy-=k*(H1*y); x=nx; y=ny;
  }
  R[0]=R0;R[1]=R1;R[2]=R2;R[3]=R3;
  return (v4){x,y,vx,vy};
}
// RK4, 10 substeps, augmented 20-vector (x, Phi)
static inline void rhs(v4 s,const v4*R,v4*ds,v4*dR){
  double x=s[0],y=s[1]; double r2=x*x+y*y,i2=1.0/r2,r=sqrt(r2),k=GE*r*(i2*i2),k5=3*k*i2;
  *ds=(v4){s[2],s[3],-k*x,-k*y};
  double gxx=k5*x*x-k,gxy=k5*x*y,gyy=k5*y*y-k;
  dR[0]=R[2];dR[1]=R[3];dR[2]=gxx*R[0]+gxy*R[1];dR[3]=gxy*R[0]+gyy*R[1];
}
static inline v4 propF_rk4(v4 s,v4 R[4],double dt,int ns){
  double h=dt/ns; R[0]=(v4){1,0,0,0};R[1]=(v4){0,1,0,0};R[2]=(v4){0,0,1,0};R[3]=(v4){0,0,0,1};
  for(int n=0;n<ns;n++){
    v4 k1,k2,k3,k4,K1[4],K2[4],K3[4],K4[4],T[4];
    rhs(s,R,&k1,K1);
    for(int i=0;i<4;i++)T[i]=R[i]+0.5*h*K1[i]; rhs(s+0.5*h*k1,T,&k2,K2);
    for(int i=0;i<4;i++)T[i]=R[i]+0.5*h*K2[i]; rhs(s+0.5*h*k2,T,&k3,K3);
    for(int i=0;i<4;i++)T[i]=R[i]+h*K3[i]; rhs(s+h*k3,T,&k4,K4);
    s+=h/6*(k1+2*k2+2*k3+k4);
    for(int i=0;i<4;i++)R[i]+=h/6*(K1[i]+2*K2[i]+2*K3[i]+K4[i]);
  }
  return s;
}
static inline void tr4(const v4*A,v4*B){
  v4 t0=__builtin_shuffle(A[0],A[1],(i4){0,4,2,6}),t1=__builtin_shuffle(A[0],A[1],(i4){1,5,3,7});
  v4 t2=__builtin_shuffle(A[2],A[3],(i4){0,4,2,6}),t3=__builtin_shuffle(A[2],A[3],(i4){1,5,3,7});
  B[0]=__builtin_shuffle(t0,t2,(i4){0,1,4,5});B[1]=__builtin_shuffle(t1,t3,(i4){0,1,4,5});
  B[2]=__builtin_shuffle(t0,t2,(i4){2,3,6,7});B[3]=__builtin_shuffle(t1,t3,(i4){2,3,6,7});
}
static inline void mm4(const v4*A,const v4*B,v4*C){ // C=A*B
  for(int i=0;i<4;i++) C[i]=A[i][0]*B[0]+A[i][1]*B[1]+A[i][2]*B[2]+A[i][3]*B[3];
}
static inline v4 mv4T(const v4*Bt,v4 x){ // B*x given rows of B^T
  return x[0]*Bt[0]+x[1]*Bt[1]+x[2]*Bt[2]+x[3]*Bt[3];
}
static inline void fpft(const v4*F,v4*P,const v4*Qd){
  v4 M[4],Ft[4]; mm4(F,P,M); tr4(F,Ft); mm4(M,Ft,P); for(int i=0;i<4;i++)P[i]+=Qd[i];
}
static inline void upd(v4*x,v4*P,double z,double R){
  v4 s=*x; double px=s[0],py=s[1],i2=1.0/(px*px+py*py);
  double h0=-py*i2,h1=px*i2; v4 PH=h0*P[0]+h1*P[1];
  double S=h0*PH[0]+h1*PH[1]+R, iS=1.0/S, e=wrap(z-atan2(py,px));
  v4 K=PH*iS; *x=s+K*e; for(int i=0;i<4;i++)P[i]-=K[i]*PH;
}
static void ld(const double*a,v4*M){for(int i=0;i<4;i++)M[i]=(v4){a[4*i],a[4*i+1],a[4*i+2],a[4*i+3]};}
static void st(double*a,const v4*M){memcpy(a,M,128);}
// mode 0: 15x1s; 1: RK4x10.  Xo[N*4], Po[N*16] (may be 0)
void ekf(int N,const double*z,const double*x0,const double*P0,const double*Qd_,double R,int mode,double*Xo,double*Po){
  v4 x,P[4],Q[4],F[4]; memcpy(&x,x0,32); ld(P0,P); ld(Qd_,Q);
  for(int k=0;k<N;k++){
    if(k){ x=mode==0?propF(x,F):propF_rk4(x,F,15.0,10); fpft(F,P,Q);}
    upd(&x,P,z[k],R);
    if(Xo)memcpy(Xo+4*k,&x,32); if(Po)st(Po+16*k,P);
  }
  if(!Xo) ; 
}
double bench_ekf(int reps,int N,const double*z,const double*x0,const double*P0,const double*Qd,double R,int mode,double*Xo,double*Po){
  double t=now(); for(int i=0;i<reps;i++)ekf(N,z,x0,P0,Qd,R,mode,Xo,Po); return (now()-t)/reps/N*1e9;
}
// ---------------- chain solver -------------------
// SIMD linearisation: 8 states at a time. X[n][4] -> f[n][4], F[n][16]; only n-1 needed.
static inline void lin8(const double*X,double*f,double*F){
  v8 x,y,vx,vy; for(int j=0;j<8;j++){x[j]=X[4*j];y[j]=X[4*j+1];vx[j]=X[4*j+2];vy[j]=X[4*j+3];}
  v8 z={0},o=z+1.0; v8 R[16]={o,z,z,z,z,o,z,z,z,z,o,z,z,z,z,o};
  for(int n=0;n<NS;n++){
    v8 r2=x*x+y*y,i2=1.0/r2,r; r=sqrt8(r2);
    v8 k=GE*r*(i2*i2),k5=3*k*i2,ax=-k*x,ay=-k*y,gxx=k5*x*x-k,gxy=k5*x*y,gyy=k5*y*y-k;
    for(int c=0;c<4;c++){ v8 A=gxx*R[c]+gxy*R[4+c],B=gxy*R[c]+gyy*R[4+c];
      R[c]+=H1*R[8+c]+H2*A; R[4+c]+=H1*R[12+c]+H2*B; R[8+c]+=H1*A; R[12+c]+=H1*B; }
    x+=H1*vx+H2*ax; y+=H1*vy+H2*ay; vx+=H1*ax; vy+=H1*ay;
  }
  for(int j=0;j<8;j++){f[4*j]=x[j];f[4*j+1]=y[j];f[4*j+2]=vx[j];f[4*j+3]=vy[j];}
  for(int j=0;j<8;j++)for(int c=0;c<16;c++)F[16*j+c]=R[c][j];
}
static inline void prop8(const double*X,double*f){
  v8 x,y,vx,vy; for(int j=0;j<8;j++){x[j]=X[4*j];y[j]=X[4*j+1];vx[j]=X[4*j+2];vy[j]=X[4*j+3];}
  for(int n=0;n<NS;n++){
    v8 r2=x*x+y*y,i2=1.0/r2,r; r=sqrt8(r2);
    v8 k=GE*r*(i2*i2),ax=-k*x,ay=-k*y;
    x+=H1*vx+H2*ax; y+=H1*vy+H2*ay; vx+=H1*ax; vy+=H1*ay;
  }
  for(int j=0;j<8;j++){f[4*j]=x[j];f[4*j+1]=y[j];f[4*j+2]=vx[j];f[4*j+3]=vy[j];}
}
typedef struct { double *f,*F,*r,*hx,*hy,*dx,*S,*K,*d,*P,*B,*Ls; int cap; } WS;
void* ws_new(int n){ WS*w=malloc(sizeof(WS)); n+=16; w->cap=n;
#define AL(p,m) w->p=aligned_alloc(64,((size_t)n*(m)*8+63)/64*64); memset(w->p,0,(size_t)n*(m)*8)
  AL(f,4);AL(F,16);AL(r,1);AL(hx,1);AL(hy,1);AL(dx,4);AL(S,1);AL(K,4);AL(d,4);AL(P,16);AL(B,16);AL(Ls,16); return w;}
// linearise; X must be padded to multiple of 8 (cap)
void lin(WS*w,int n,const double*X,const double*z,int simd){
  if(simd) for(int k=0;k<n-1;k+=8) lin8(X+4*k,w->f+4*k,w->F+16*k);
  else for(int k=0;k<n-1;k++){ v4 s,R[4]; memcpy(&s,X+4*k,32); s=propF(s,R); memcpy(w->f+4*k,&s,32); st(w->F+16*k,R);}
  for(int k=0;k<n;k++){ double x=X[4*k],y=X[4*k+1],i2=1/(x*x+y*y); w->hx[k]=-y*i2;w->hy[k]=x*i2; w->r[k]=wrap(z[k]-atan2(y,x)); }
}
// cost = sum of squared whitened residuals. Qd diag.
double cost(WS*w,int n,const double*X,const double*z,const double*m,const double*Li,const double*qi,double R,int simd,double*fbuf){
  double c=0; 
  if(simd) for(int k=0;k<n-1;k+=8) prop8(X+4*k,fbuf+4*k);
  else for(int k=0;k<n-1;k++){v4 s;memcpy(&s,X+4*k,32);s=prop(s);memcpy(fbuf+4*k,&s,32);}
  for(int k=0;k<n-1;k++) for(int i=0;i<4;i++){double e=X[4*k+4+i]-fbuf[4*k+i]; c+=e*e*qi[i];}
  double cm=0; for(int k=0;k<n;k++){double e=wrap(z[k]-atan2(X[4*k+1],X[4*k]));cm+=e*e;}
  c+=cm/R;
  for(int i=0;i<4;i++)for(int j=0;j<4;j++)c+=(X[i]-m[i])*Li[4*i+j]*(X[j]-m[j]);
  return c;
}
// covariance form GN step: forward linearised KF, backward Bryson-Frazier vector recursion. dx in w->dx
void step_cov(WS*w,int n,const double*X,const double*m,const double*Pm,const double*Qd_,double R,int storeP){
  v4 P[4],Q[4]; ld(Pm,P); ld(Qd_,Q); v4 d,t; memcpy(&d,m,32); memcpy(&t,X,32); d-=t;
  v4*D=(v4*)w->d,*Kk=(v4*)w->K,*PP=(v4*)w->P; 
  for(int k=0;k<n;k++){
    if(k){ v4 F[4],Ft[4],M[4]; ld(w->F+16*(k-1),F); tr4(F,Ft); mm4(F,P,M); mm4(M,Ft,P); for(int i=0;i<4;i++)P[i]+=Q[i];
      v4 a,b; memcpy(&a,w->f+4*(k-1),32); memcpy(&b,X+4*k,32); d=mv4T(Ft,d)+(a-b); }
    D[k]=d; for(int i=0;i<4;i++)PP[4*k+i]=P[i];   // predicted
    double h0=w->hx[k],h1=w->hy[k]; v4 PH=h0*P[0]+h1*P[1]; double iS=1.0/(h0*PH[0]+h1*PH[1]+R); v4 K=PH*iS;
    double e=w->r[k]-h0*d[0]-h1*d[1]; w->B[k]=e*iS; w->S[k]=iS; Kk[k]=K;
    d+=K*e; for(int i=0;i<4;i++)P[i]-=K[i]*PH;
  }
  v4 lam={0,0,0,0}; v4*dx=(v4*)w->dx;
  for(int k=n-1;k>=0;k--){
    if(k<n-1){ const double*F=w->F+16*k; v4 Fr[4]; ld(F,Fr); lam=lam[0]*Fr[0]+lam[1]*Fr[1]+lam[2]*Fr[2]+lam[3]*Fr[3]; }
    v4 K=Kk[k]; double g=w->B[k]+ (K[0]*lam[0]+K[1]*lam[1]+K[2]*lam[2]+K[3]*lam[3]);
    lam-= (v4){w->hx[k]*g,w->hy[k]*g,0,0};
    v4*p=PP+4*k; dx[k]=D[k]-(lam[0]*p[0]+lam[1]*p[1]+lam[2]*p[2]+lam[3]*p[3]);
  }
}
// marginal covariances after step_cov (backward Lambda recursion): Ps=P-P L P
void marg_cov(WS*w,int n,double*Ps){
  v4 L[4]={{0}}; v4*PP=(v4*)w->P,*Kk=(v4*)w->K;
  for(int k=n-1;k>=0;k--){
    if(k<n-1){ v4 F[4],Ft[4],M[4]; ld(w->F+16*k,F); tr4(F,Ft); mm4(Ft,L,M); mm4(M,F,L); }
    double h0=w->hx[k],h1=w->hy[k]; v4 K=Kk[k];
    // L <- H'H iS + (I-KH)'L(I-KH)
    v4 LK=K[0]*L[0]+K[1]*L[1]+K[2]*L[2]+K[3]*L[3]; double kk=K[0]*LK[0]+K[1]*LK[1]+K[2]*LK[2]+K[3]*LK[3]+w->S[k];
    v4 Hh={h0,h1,0,0};
    for(int i=0;i<4;i++){ L[i]-= LK[i]*Hh; }
    L[0]-=h0*LK; L[1]-=h1*LK; L[0]+=h0*kk*Hh; L[1]+=h1*kk*Hh;
    v4 M[4],T[4]; mm4(PP+4*k,L,M); mm4(M,PP+4*k,T); for(int i=0;i<4;i++)T[i]=PP[4*k+i]-T[i]; st(Ps+16*k,T);
  }
}
// ---- block tridiagonal Cholesky (information form), scalar unrolled by compiler
static inline int chol4(double*A){ // lower in place
  for(int j=0;j<4;j++){ double s=A[5*j]; for(int k=0;k<j;k++)s-=A[4*j+k]*A[4*j+k]; if(!(s>0))return 0; s=sqrt(s); double is=1/s; A[5*j]=is; // store inverse diag
    for(int i=j+1;i<4;i++){ double t=A[4*i+j]; for(int k=0;k<j;k++)t-=A[4*i+k]*A[4*j+k]; A[4*i+j]=t*is; } }
  return 1; }
// lam: LM damping (multiplies diag of Hessian). Returns 0 on failure. Gradient-model: pred decrease in *pred
int step_chol(WS*w,int n,const double*X,const double*z,const double*m,const double*Li,const double*qi,double R,double lmb,double*pred){
  double iR=1/R; double g[4]={0},D[16],g0[4]; 
  // running Schur complement S and rhs b for block k
  double S[16],b[4]; double pd=0;
  for(int i=0;i<4;i++){b[i]=0;for(int j=0;j<4;j++){S[4*i+j]=Li[4*i+j]; b[i]+=Li[4*i+j]*(m[j]-X[j]);}}
  double *G=w->B,*Ls=w->Ls,*y=w->d;
  for(int k=0;k<n;k++){
    double h0=w->hx[k],h1=w->hy[k],r=w->r[k]*iR;
    double dg[4]; 
    S[0]+=h0*h0*iR;S[1]+=h0*h1*iR;S[4]+=h0*h1*iR;S[5]+=h1*h1*iR; b[0]+=h0*r;b[1]+=h1*r;
    const double*F=w->F+16*k; double QF[16];
    if(k<n-1){ 
      for(int i=0;i<4;i++)for(int j=0;j<4;j++)QF[4*i+j]=qi[i]*F[4*i+j];
      for(int i=0;i<4;i++)for(int j=0;j<4;j++){double s=0;for(int l=0;l<4;l++)s+=F[4*l+i]*QF[4*l+j];S[4*i+j]+=s;}
      double e[4]; for(int i=0;i<4;i++)e[i]=X[4*k+4+i]-w->f[4*k+i];
      for(int i=0;i<4;i++){double s=0;for(int l=0;l<4;l++)s+=QF[4*l+i]*e[l]; b[i]+=s;}
    }
    if(lmb>0){ // damping on the true Hessian diagonal
      double d[4]; for(int i=0;i<4;i++){ d[i]= (k==0?Li[5*i]:qi[i]); if(k<n-1)for(int l=0;l<4;l++)d[i]+=F[4*l+i]*QF[4*l+i]; }
      d[0]+=h0*h0*iR; d[1]+=h1*h1*iR; for(int i=0;i<4;i++)S[5*i]+=lmb*d[i]; }
    double*L=Ls+16*k; memcpy(L,S,128); if(!chol4(L))return 0;
    double yy[4]; for(int i=0;i<4;i++){double s=b[i];for(int l=0;l<i;l++)s-=L[4*i+l]*yy[l]; yy[i]=s*L[5*i]; y[4*k+i]=yy[i];}
    pd+=yy[0]*yy[0]+yy[1]*yy[1]+yy[2]*yy[2]+yy[3]*yy[3];
    if(k<n-1){ // W = B L^-T, B=-QF (rows k+1, cols k)
      double*W=G+16*k; for(int i=0;i<4;i++)for(int j=0;j<4;j++){double s=-QF[4*i+j];for(int l=0;l<j;l++)s-=W[4*i+l]*L[4*j+l]; W[4*i+j]=s*L[5*j];}
      double e[4]; for(int i=0;i<4;i++)e[i]=w->f[4*k+i]-X[4*k+4+i];
      for(int i=0;i<4;i++){ for(int j=0;j<4;j++){double s=(i==j)?qi[i]:0;for(int l=0;l<4;l++)s-=W[4*i+l]*W[4*j+l];S[4*i+j]=s;}
        double s=qi[i]*e[i]; for(int l=0;l<4;l++)s-=W[4*i+l]*yy[l]; b[i]=s; }
    }
  }
  double*dx=w->dx; 
  for(int k=n-1;k>=0;k--){ double t[4]; double*L=Ls+16*k; for(int i=0;i<4;i++)t[i]=y[4*k+i];
    if(k<n-1){double*W=G+16*k;double*d=dx+4*k+4;for(int i=0;i<4;i++)for(int l=0;l<4;l++)t[i]-=W[4*l+i]*d[l];}
    for(int i=3;i>=0;i--){double s=t[i];for(int l=i+1;l<4;l++)s-=L[4*l+i]*dx[4*k+l]; dx[4*k+i]=s*L[5*i];} }
  if(pred)*pred=pd; return 1;
}
// Takahashi: Sig_kk = L^-T L^-1 + C Sig_{k+1} C^T, C = -L^-T W^T ...
void marg_chol(WS*w,int n,double*Ps){
  for(int k=n-1;k>=0;k--){ double*L=w->Ls+16*k; double Li[16]={0};
    for(int j=0;j<4;j++){Li[5*j]=L[5*j];for(int i=j+1;i<4;i++){double s=0;for(int l=j;l<i;l++)s-=L[4*i+l]*Li[4*l+j];Li[4*i+j]=s*L[5*i];}}
    double*S=Ps+16*k; 
    for(int i=0;i<4;i++)for(int j=0;j<4;j++){double s=0;for(int l=0;l<4;l++)s+=Li[4*l+i]*Li[4*l+j];S[4*i+j]=s;}
    if(k<n-1){ double*W=w->B+16*k,*Sn=Ps+16*(k+1),C[16],M[16]; // C = L^-T W^T  (4x4)
      for(int i=0;i<4;i++)for(int j=0;j<4;j++){double s=0;for(int l=0;l<4;l++)s+=Li[4*l+i]*W[4*j+l];C[4*i+j]=s;}
      for(int i=0;i<4;i++)for(int j=0;j<4;j++){double s=0;for(int l=0;l<4;l++)s+=C[4*i+l]*Sn[4*l+j];M[4*i+j]=s;}
      for(int i=0;i<4;i++)for(int j=0;j<4;j++){double s=0;for(int l=0;l<4;l++)s+=M[4*i+l]*C[4*j+l];S[4*i+j]+=s;} } }
}
static void inv4(const double*A,double*B){ double a[4][8]; for(int i=0;i<4;i++)for(int j=0;j<4;j++){a[i][j]=A[4*i+j];a[i][4+j]=i==j;}
  for(int c=0;c<4;c++){int p=c;for(int i=c;i<4;i++)if(fabs(a[i][c])>fabs(a[p][c]))p=i; if(p!=c)for(int j=0;j<8;j++){double t=a[p][j];a[p][j]=a[c][j];a[c][j]=t;}
    double d=1/a[c][c];for(int j=0;j<8;j++)a[c][j]*=d;for(int i=0;i<4;i++)if(i!=c){double f=a[i][c];for(int j=0;j<8;j++)a[i][j]-=f*a[c][j];}}
  for(int i=0;i<4;i++)for(int j=0;j<4;j++)B[4*i+j]=a[i][4+j]; }
// Full FG.  method 0: GN full step (cov form); 1: GN with halving on actual decrease (cov form); 2: LM (chol); 3: GN chol full step; 4 GN chol line search
// hist[it*2]=cost, hist[it*2+1]=step size.  returns iterations
int fg(void*ws_,int N,double*X,const double*z,const double*x0,const double*P0,const double*Qd,double R,int method,int simd,int maxit,double tol,double*Ps,double*hist,double*Xt){
  WS*w=ws_; double qi[4],Li[16]; for(int i=0;i<4;i++)qi[i]=1/Qd[5*i]; inv4(P0,Li); double lmb=(method==2)?1e-6:0,nu=2; int it; 
  double c=cost(w,N,X,z,x0,Li,qi,R,simd,w->f); int chol=method>=2;
  if(hist){hist[0]=c;hist[1]=0;}
  for(it=1;it<=maxit;it++){
    lin(w,N,X,z,simd); double cn,al=1; int ok; double ndx=0;
    if(method==2){ int tries=0; ok=0;
      while(tries++<40){ if(!step_chol(w,N,X,z,x0,Li,qi,R,lmb,0)){lmb*=10;continue;}
        for(int i=0;i<4*N;i++)Xt[i]=X[i]+w->dx[i]; 
        cn=cost(w,N,Xt,z,x0,Li,qi,R,simd,w->d); if(cn<c){ok=1;lmb=lmb>1e-14?lmb*0.1:lmb;break;} lmb*=10; 
        if(fabs(cn-c)<1e-9*c){ok=1;break;} }
    } else {
      if(chol){ if(!step_chol(w,N,X,z,x0,Li,qi,R,0,0))return -it; } else step_cov(w,N,X,x0,P0,Qd,R,1);
      ok=1; int tries=0;
      for(;;){ for(int i=0;i<4*N;i++)Xt[i]=X[i]+al*w->dx[i]; cn=cost(w,N,Xt,z,x0,Li,qi,R,simd,w->Ls);
        if(method==0||method==3||cn<c*(1+1e-10)||tries++>20)break; al*=0.5; }
    }
    for(int i=0;i<4*N;i++){double a=fabs(al*w->dx[i]); if(a>ndx)ndx=a;}
    memcpy(X,Xt,32*(size_t)N); 
    if(hist){hist[2*it]=cn;hist[2*it+1]=al;}
    double dc=fabs(c-cn); c=cn; if(!ok) break; if(dc<tol*(1+c)) {it++;break;} }
  it--;
  if(Ps){ lin(w,N,X,z,simd); if(chol){ if(step_chol(w,N,X,z,x0,Li,qi,R,0,0)) marg_chol(w,N,Ps);} else {step_cov(w,N,X,x0,P0,Qd,R,1); marg_cov(w,N,Ps);} }
  return it;
}
// fixed-lag, covariance form.  newest[N][4], oldest[N][4]; Pn[N][16]
// the window lives in a flat buffer Xb (N+16); prior (m,P) on the oldest state
void fixedlag(void*ws_,int N,const double*z,const double*x0,const double*P0,const double*Qd,double R,int W,int iters,int simd,int form,double*Xb,double*newest,double*Pn,double*oldest,int linesearch){
  WS*w=ws_; v4 m,P[4],Q[4]; memcpy(&m,x0,32); ld(P0,P); ld(Qd,Q); memcpy(Xb,x0,32); int a=0; // oldest index
  double qi[4],Li[16]; for(int i=0;i<4;i++)qi[i]=1/Qd[5*i];
  for(int k=0;k<N;k++){
    if(k){ v4 s; memcpy(&s,Xb+4*(k-1),32); s=prop(s); memcpy(Xb+4*k,&s,32);
      if(k-a+1>W){ // the oldest leaves: its measurement keeps its last linearisation (w->hx, w->r, about xl - w->dx), its dynamics are linearised at xl
        v4 xl,dl,F[4],fx; memcpy(&xl,Xb+4*a,32); memcpy(&dl,w->dx,32); memcpy(oldest+4*a,&xl,32);
        double h0=w->hx[0],h1=w->hy[0]; v4 d=m-(xl-dl); v4 PH=h0*P[0]+h1*P[1];
        double iS=1/(h0*PH[0]+h1*PH[1]+R),e=w->r[0]-h0*d[0]-h1*d[1]; v4 K=PH*iS; m+=K*e; for(int i=0;i<4;i++)P[i]-=K[i]*PH;
        d=m-xl; fx=propF(xl,F); v4 Ft[4]; tr4(F,Ft); m=fx+mv4T(Ft,d); fpft(F,P,Q); a++; } }
    int n=k-a+1; double*X=Xb+4*a; double Pm[16]; st(Pm,P); double mm[4]; memcpy(mm,&m,32);
    if(form==1||linesearch)inv4(Pm,Li);
    for(int it=0;it<iters;it++){
      // pad region beyond n with a valid state so SIMD is safe
      if(simd) for(int j=n;j<n+8;j++)memcpy(X+4*j,X+4*(n-1),32);
      lin(w,n,X,z+a,simd);
      if(form==0) step_cov(w,n,X,mm,Pm,Qd,R,1); else if(!step_chol(w,n,X,z+a,mm,Li,qi,R,0,0)) break;
      if(linesearch){ double c0=cost(w,n,X,z+a,mm,Li,qi,R,simd,w->Ls),al=1; double*Xt=newest+4*(size_t)(N+16);
        for(int t=0;t<12;t++){ for(int i=0;i<4*n;i++)Xt[i]=X[i]+al*w->dx[i]; if(simd)for(int j=n;j<n+8;j++)memcpy(Xt+4*j,Xt+4*(n-1),32);
          if(cost(w,n,Xt,z+a,mm,Li,qi,R,simd,w->Ls)<c0)break; al*=0.5;}
        for(int i=0;i<4*n;i++)X[i]+=al*w->dx[i]; }
      else for(int i=0;i<4*n;i++)X[i]+=w->dx[i];
    }
    memcpy(newest+4*k,X+4*(n-1),32);
    if(Pn&&form==0){ v4*pp=(v4*)w->P+4*(n-1),T[4],K=((v4*)w->K)[n-1]; double h0=w->hx[n-1],h1=w->hy[n-1]; v4 PH=h0*pp[0]+h1*pp[1]; for(int i=0;i<4;i++)T[i]=pp[i]-K[i]*PH; st(Pn+16*k,T);}
  }
  for(int j=a;j<N;j++)memcpy(oldest+4*j,Xb+4*j,32);
}
double bench_fl(int reps,void*ws,int N,const double*z,const double*x0,const double*P0,const double*Qd,double R,int W,int iters,int simd,int form,double*Xb,double*newest,double*oldest){
  double t=now(); for(int i=0;i<reps;i++)fixedlag(ws,N,z,x0,P0,Qd,R,W,iters,simd,form,Xb,newest,0,oldest,0); return (now()-t)/reps/N*1e6; }
double bench_part(int what,int reps,void*ws,int N,double*X,const double*z,const double*x0,const double*P0,const double*Qd,double R,double*Ps,double*buf){
  WS*w=ws; double qi[4],Li[16]; for(int i=0;i<4;i++)qi[i]=1/Qd[5*i]; inv4(P0,Li); volatile double s=0; double t=now();
  for(int i=0;i<reps;i++) switch(what){
    case 0: lin(w,N,X,z,0);break; case 1: lin(w,N,X,z,1);break; case 2: step_cov(w,N,X,x0,P0,Qd,R,1);break;
    case 3: step_chol(w,N,X,z,x0,Li,qi,R,0,0);break; case 4: marg_cov(w,N,Ps);break; case 5: marg_chol(w,N,Ps);break;
    case 6: s+=cost(w,N,X,z,x0,Li,qi,R,0,buf);break; case 7: s+=cost(w,N,X,z,x0,Li,qi,R,1,buf);break; }
  return (now()-t)/reps*1e6; }
// ---------------- Monte Carlo -------------------
// zr: [runs][N], x0r [runs][4]
typedef struct {int r0,r1,N,runs;const double*z,*x0,*P0,*Qd;double R;double*out;int mode;} MC;
#ifdef __AVX512F__
extern v8 _ZGVeN8vv_atan2(v8,v8);
static inline v8 atan2_8(v8 y,v8 x){ return _ZGVeN8vv_atan2(y,x); }
#else
static inline v8 atan2_8(v8 y,v8 x){ v8 o; for(int j=0;j<8;j++)o[j]=atan2(y[j],x[j]); return o; }
#endif
static void* mc_scalar(void*a_){MC*a=a_; for(int r=a->r0;r<a->r1;r++){ v4 x,P[4],Q[4],F[4]; memcpy(&x,a->x0+4*r,32); ld(a->P0,P); ld(a->Qd,Q); const double*z=a->z+(size_t)r*a->N;
   for(int k=0;k<a->N;k++){ if(k){x=propF(x,F);fpft(F,P,Q);} upd(&x,P,z[k],a->R);} memcpy(a->out+4*r,&x,32);} return 0;}
// SoA: z [N][runs] , 8 runs per vector
static void* mc_simd(void*a_){MC*a=a_; double R_=a->R;
 for(int r=a->r0;r<a->r1;r+=8){ v8 x,y,u,v,P[10]; // sym: 00 01 02 03 11 12 13 22 23 33
   for(int j=0;j<8;j++){const double*q=a->x0+4*(r+j);x[j]=q[0];y[j]=q[1];u[j]=q[2];v[j]=q[3];}
   v8 zz={0}; const double*p0=a->P0; int id[10]={0,1,2,3,5,6,7,10,11,15}; for(int i=0;i<10;i++)P[i]=zz+p0[id[i]];
   for(int k=0;k<a->N;k++){
     if(k){ v8 o=zz+1.0; v8 M[16]={o,zz,zz,zz,zz,o,zz,zz,zz,zz,o,zz,zz,zz,zz,o};
       for(int n=0;n<NS;n++){ v8 r2=x*x+y*y,i2=1.0/r2,rr; rr=sqrt8(r2);
         v8 kk=GE*rr*(i2*i2),k5=3*kk*i2,ax=-kk*x,ay=-kk*y,gxx=k5*x*x-kk,gxy=k5*x*y,gyy=k5*y*y-kk;
         for(int c=0;c<4;c++){ v8 A=gxx*M[c]+gxy*M[4+c],B=gxy*M[c]+gyy*M[4+c]; M[c]+=H1*M[8+c]+H2*A; M[4+c]+=H1*M[12+c]+H2*B; M[8+c]+=H1*A; M[12+c]+=H1*B; }
         x+=H1*u+H2*ax; y+=H1*v+H2*ay; u+=H1*ax; v+=H1*ay; }
       v8 S[16]={P[0],P[1],P[2],P[3],P[1],P[4],P[5],P[6],P[2],P[5],P[7],P[8],P[3],P[6],P[8],P[9]},T[16];
       for(int i=0;i<4;i++)for(int j=0;j<4;j++)T[4*i+j]=M[4*i]*S[j]+M[4*i+1]*S[4+j]+M[4*i+2]*S[8+j]+M[4*i+3]*S[12+j];
       int q=0; for(int i=0;i<4;i++)for(int j=i;j<4;j++,q++)P[q]=T[4*i]*M[4*j]+T[4*i+1]*M[4*j+1]+T[4*i+2]*M[4*j+2]+T[4*i+3]*M[4*j+3]+a->Qd[4*i+j];
     }
     v8 i2=1.0/(x*x+y*y),h0=-y*i2,h1=x*i2; v8 p0_=h0*P[0]+h1*P[1],p1=h0*P[1]+h1*P[4],p2=h0*P[2]+h1*P[5],p3=h0*P[3]+h1*P[6];
     v8 iS=1.0/(h0*p0_+h1*p1+R_); v8 e=*(const v8u*)(a->z+(size_t)k*a->runs+r)-atan2_8(y,x);
     for(int j=0;j<8;j++){double q=e[j];q=q>M_PI?q-2*M_PI:q;e[j]=q<-M_PI?q+2*M_PI:q;} v8 ei=e*iS; x+=p0_*ei;y+=p1*ei;u+=p2*ei;v+=p3*ei;
     P[0]-=p0_*p0_*iS;P[1]-=p0_*p1*iS;P[2]-=p0_*p2*iS;P[3]-=p0_*p3*iS;P[4]-=p1*p1*iS;P[5]-=p1*p2*iS;P[6]-=p1*p3*iS;P[7]-=p2*p2*iS;P[8]-=p2*p3*iS;P[9]-=p3*p3*iS;
   }
   for(int j=0;j<8;j++){double*q=a->out+4*(r+j);q[0]=x[j];q[1]=y[j];q[2]=u[j];q[3]=v[j];}
 } return 0;}
double mc(int runs,int N,const double*z,const double*x0,const double*P0,const double*Qd,double R,double*out,int mode,int threads){
  double t=wall(); MC a[2]; pthread_t th; int half=threads==2?runs/2/8*8:runs; 
  a[0]=(MC){0,half,N,runs,z,x0,P0,Qd,R,out,mode}; a[1]=a[0]; a[1].r0=half;a[1].r1=runs; void*(*fn)(void*)=mode?mc_simd:mc_scalar;
  if(threads==2)pthread_create(&th,0,fn,&a[1]); fn(&a[0]); if(threads==2)pthread_join(th,0); return runs/(wall()-t); }
// like-for-like FG: fixed its, no cost evaluations, marginals at end.  thread CPU ms per call
double bench_fg0(int reps,void*ws_,int N,const double*Xi,double*X,const double*z,const double*x0,const double*P0,const double*Qd,double R,int its,double*Ps,int simd){
  WS*w=ws_; double t=now(); for(int r=0;r<reps;r++){ memcpy(X,Xi,32*(size_t)(N+16)); for(int it=0;it<its;it++){ lin(w,N,X,z,simd); step_cov(w,N,X,x0,P0,Qd,R,1); for(int i=0;i<4*N;i++)X[i]+=w->dx[i]; } if(Ps){lin(w,N,X,z,simd); step_cov(w,N,X,x0,P0,Qd,R,1); marg_cov(w,N,Ps);} }
  return (now()-t)/reps*1e3; }
double bench_fg1(int reps,void*ws_,int N,const double*Xi,double*X,const double*z,const double*x0,const double*P0,const double*Qd,double R,int its,double*Ps,int simd){
  WS*w=ws_; double qi[4],Li[16];for(int i=0;i<4;i++)qi[i]=1/Qd[5*i];inv4(P0,Li); double t=now(); for(int r=0;r<reps;r++){ memcpy(X,Xi,32*(size_t)(N+16)); for(int it=0;it<its;it++){ lin(w,N,X,z,simd); step_chol(w,N,X,z,x0,Li,qi,R,0,0); for(int i=0;i<4*N;i++)X[i]+=w->dx[i]; } if(Ps){lin(w,N,X,z,simd); step_chol(w,N,X,z,x0,Li,qi,R,0,0); marg_chol(w,N,Ps);} }
  return (now()-t)/reps*1e3; }
